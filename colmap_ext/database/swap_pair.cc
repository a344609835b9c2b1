// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/swap_pair.h"

#include <Eigen/Geometry>
#include <cstring>
#include <utility>

#include "core/types.h"

namespace adasfm {
namespace {

std::vector<char>* FindBlob(std::map<std::string, SqliteValue>* row,
                            const std::string& column) {
  const auto value = row->find(column);
  if (value == row->end()) return nullptr;
  auto* blob = std::get_if<std::vector<char>>(&value->second);
  return blob == nullptr || blob->empty() ? nullptr : blob;
}

// Calls function(matrix) for a blob of a matrix that is neither missing nor
// zeros.
template <typename Matrix, typename Function>
void ChangeMatrix(std::map<std::string, SqliteValue>* row,
                  const std::string& column, const Function& function) {
  std::vector<char>* blob = FindBlob(row, column);
  if (blob == nullptr) return;
  Matrix matrix;
  if (blob->size() != sizeof(double) * matrix.size()) {
    throw SqliteError("column " + column + ": a matrix of " +
                      std::to_string(blob->size()) + " bytes");
  }
  std::memcpy(matrix.data(), blob->data(), blob->size());
  if (matrix.isZero(0.0)) return;
  matrix = function(matrix).eval();
  std::memcpy(blob->data(), matrix.data(), blob->size());
}

void SwapMatches(std::map<std::string, SqliteValue>* row) {
  std::vector<char>* blob = FindBlob(row, "data");
  if (blob == nullptr) return;
  if (blob->size() % sizeof(FeatureMatch) != 0) {
    throw SqliteError("malformed matches");
  }
  constexpr size_t kHalf = sizeof(FeatureMatch) / 2;
  for (size_t i = 0; i < blob->size(); i += sizeof(FeatureMatch)) {
    std::swap_ranges(blob->begin() + i, blob->begin() + i + kHalf,
                     blob->begin() + i + kHalf);
  }
}

void InvertPose(std::map<std::string, SqliteValue>* row) {
  Eigen::Quaterniond inverse = Eigen::Quaterniond::Identity();
  bool has_rotation = false;
  ChangeMatrix<Eigen::Vector4d>(row, "qvec", [&](const Eigen::Vector4d& q) {
    inverse = Eigen::Quaterniond(q(0), -q(1), -q(2), -q(3)).normalized();
    has_rotation = true;
    return Eigen::Vector4d(q(0), -q(1), -q(2), -q(3));
  });
  if (!has_rotation) return;
  ChangeMatrix<Eigen::Vector3d>(
      row, "tvec", [&](const Eigen::Vector3d& t) -> Eigen::Vector3d {
        return -(inverse * t);
      });
}

}  // namespace

void SwapPair(std::map<std::string, SqliteValue>* row) {
  using Matrix = Eigen::Matrix3d;
  SwapMatches(row);
  for (const char* column : {"F", "E"}) {
    ChangeMatrix<Matrix>(row, column,
                         [](const Matrix& m) { return m.transpose(); });
  }
  // Row and column order do not matter for transposing and inverting.
  ChangeMatrix<Matrix>(row, "H",
                       [](const Matrix& m) -> Matrix { return m.inverse(); });
  InvertPose(row);
  const auto camera1 = row->find("camera1");
  const auto camera2 = row->find("camera2");
  if (camera1 != row->end() && camera2 != row->end()) {
    std::swap(camera1->second, camera2->second);
  }
}

}  // namespace adasfm
