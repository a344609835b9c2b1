// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/descriptors.h"

#include <cstring>
#include <string>

#include "colmap_ext/host/database_schema.h"

namespace adasfm {
namespace {

// Values of descriptors.type in COLMAP 4: SIFT has one byte per number; the two
// kinds of ALIKED store floats in the same table of bytes.
constexpr int64_t kSift = 0;
constexpr int64_t kLastAliked = 2;

[[noreturn]] void ThrowDescriptorError(int64_t image_id,
                                       const std::string& what) {
  throw SqliteError("table descriptors, row " + std::to_string(image_id) +
                    ": " + what);
}

DescriptorMatrix DescriptorsFromRow(const SqliteStatement& statement) {
  const int64_t image_id = statement.Int(0);
  const int64_t num_rows = statement.Int(1);
  const int64_t num_bytes_per_row = statement.Int(2);
  const int64_t type = statement.Int(4);
  if (type < kSift || type > kLastAliked) {
    ThrowDescriptorError(image_id,
                         "descriptors of the type " + std::to_string(type) +
                             ", which this program does not have; give "
                             "--AdaSfmPairs.descriptors_path instead");
  }
  const int64_t value_size = type == kSift ? 1 : sizeof(float);
  const int64_t num_bytes = statement.NumBytes(3);
  // The bounds ensure that the product cannot overflow.
  if (num_rows < 1 || num_rows > num_bytes || num_bytes_per_row < 1 ||
      num_bytes_per_row > num_bytes || num_bytes_per_row % value_size != 0 ||
      num_bytes != num_rows * num_bytes_per_row) {
    ThrowDescriptorError(image_id, "malformed descriptors");
  }
  DescriptorMatrix descriptors(num_rows, num_bytes_per_row / value_size);
  if (type == kSift) {
    descriptors =
        Eigen::Map<const Eigen::Matrix<unsigned char, Eigen::Dynamic,
                                       Eigen::Dynamic, Eigen::RowMajor>>(
            static_cast<const unsigned char*>(statement.Blob(3)),
            descriptors.rows(), descriptors.cols())
            .cast<float>();
    return descriptors;
  }
  std::memcpy(descriptors.data(), statement.Blob(3),
              descriptors.size() * sizeof(float));
  if (!descriptors.allFinite()) {
    ThrowDescriptorError(image_id, "a descriptor that is not finite");
  }
  return descriptors;
}

}  // namespace

void ReadDescriptors(
    SqliteConnection* database,
    const std::function<void(image_t, const DescriptorMatrix&)>& function) {
  const bool has_type = HasColumn(database, "descriptors", "type");
  SqliteStatement statement(database,
                            std::string("SELECT image_id, rows, cols, data, ") +
                                (has_type ? "type" : "0") +
                                " FROM descriptors WHERE rows > 0 AND image_id "
                                "IN (SELECT image_id FROM images) "
                                "ORDER BY image_id");
  int64_t first_type = -1;
  while (statement.Step()) {
    const DescriptorMatrix descriptors = DescriptorsFromRow(statement);
    if (first_type < 0) first_type = statement.Int(4);
    if (statement.Int(4) != first_type) {
      ThrowDescriptorError(
          statement.Int(0),
          "descriptors of another type than those of the images before");
    }
    function(statement.Int(0), descriptors);
  }
}

}  // namespace adasfm
