// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/sizes_by_closure.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <map>

namespace adasfm {
namespace {

// As for scales that compare through keypoints (spread_lengths.cc).
constexpr double kMaxSizeSigma = 0.05;
// Prior sigma, as a share of a scale and of the extent of the whole: so weak
// that it does not affect a ring.
constexpr double kFreeSigma = 100.0;
// A place that two sets share is exact to this share of the extent.
constexpr double kPlaceSigma = 1e-4;
constexpr int kUnknowns = 4;  // size and place

struct Joint {
  int set = 0;
  Eigen::Vector3d arm;  // from the mean of the set's joints
};

class ClosureProblem {
 public:
  ClosureProblem(const std::vector<SizedSet>& sets,
                 const std::vector<std::optional<Eigen::Vector3d>>& centers)
      : sets_(sets), centers_(centers) {
    std::vector<int> num_sets(centers.size(), 0);
    for (const SizedSet& set : sets) {
      for (const int image : set.images) ++num_sets[image];
    }
    for (size_t k = 0; k < sets.size(); ++k) AddSet(k, num_sets);
  }

  bool HasRings() const { return num_rows_ > 0; }

  // Covariance of the scales of all sets that close rings.
  Eigen::MatrixXd SizeCovariance() {
    const Eigen::SparseMatrix<double> information = Information();
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt(information);
    Eigen::MatrixXd covariance(ring_sets_.size(), ring_sets_.size());
    for (size_t a = 0; a < ring_sets_.size(); ++a) {
      const Eigen::VectorXd column =
          ldlt.solve(Eigen::VectorXd::Unit(information.rows(), kUnknowns * a));
      for (size_t b = 0; b < ring_sets_.size(); ++b) {
        covariance(b, a) = column[kUnknowns * b];
      }
    }
    return covariance;
  }

  const std::vector<int>& RingSets() const { return ring_sets_; }

 private:
  // A set with fewer than two joints is in no ring.
  void AddSet(int k, const std::vector<int>& num_sets) {
    std::vector<int> shared;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const int image : sets_[k].images) {
      if (num_sets[image] < 2 || !centers_[image].has_value()) continue;
      shared.push_back(image);
      mean += *centers_[image];
    }
    if (shared.size() < 2) return;
    mean /= static_cast<double>(shared.size());
    const int index = static_cast<int>(ring_sets_.size());
    ring_sets_.push_back(k);
    for (const int image : shared) {
      const Eigen::Vector3d arm = *centers_[image] - mean;
      extent_ = std::max(extent_, arm.norm());
      std::vector<Joint>& joints = joints_[image];
      num_rows_ += !joints.empty();
      joints.push_back({index, arm});
    }
  }

  Eigen::SparseMatrix<double> Information() const {
    const int size = kUnknowns * static_cast<int>(ring_sets_.size());
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&entries](int row, int column, double value) {
      entries.emplace_back(row, column, value);
    };
    for (int i = 0; i < size; ++i) {
      const double sigma =
          i % kUnknowns == 0 ? kFreeSigma : kFreeSigma * extent_;
      add(i, i, 1.0 / (sigma * sigma));
    }
    for (const auto& [image, joints] : joints_) {
      for (size_t j = 1; j < joints.size(); ++j) {
        AddClosure(joints[0], joints[j], add);
      }
    }
    Eigen::SparseMatrix<double> information(size, size);
    information.setFromTriplets(entries.begin(), entries.end());
    return information;
  }

  // t_a + s_a arm_a = t_b + s_b arm_b.
  template <typename Add>
  void AddClosure(const Joint& a, const Joint& b, const Add& add) const {
    const auto variance = [this](const Joint& joint) {
      return std::pow(sets_[ring_sets_[joint.set]].shape_sigma, 2) *
             joint.arm.squaredNorm();
    };
    const double weight =
        1.0 / (variance(a) + variance(b) + std::pow(kPlaceSigma * extent_, 2));
    for (int axis = 0; axis < 3; ++axis) {
      const std::pair<int, double> row[] = {
          {kUnknowns * a.set, a.arm[axis]},
          {kUnknowns * a.set + 1 + axis, 1.0},
          {kUnknowns * b.set, -b.arm[axis]},
          {kUnknowns * b.set + 1 + axis, -1.0}};
      for (const auto& [i, left] : row) {
        for (const auto& [j, right] : row) add(i, j, weight * left * right);
      }
    }
  }

  const std::vector<SizedSet>& sets_;
  const std::vector<std::optional<Eigen::Vector3d>>& centers_;
  std::vector<int> ring_sets_;
  std::map<int, std::vector<Joint>> joints_;  // by image
  double extent_ = 0.0;
  int num_rows_ = 0;
};

}  // namespace

std::vector<std::pair<int, int>> FindSizesByClosure(
    const std::vector<SizedSet>& sets,
    const std::vector<std::optional<Eigen::Vector3d>>& centers) {
  std::vector<std::pair<int, int>> pairs;
  ClosureProblem problem(sets, centers);
  if (!problem.HasRings()) return pairs;
  const Eigen::MatrixXd covariance = problem.SizeCovariance();
  const std::vector<int>& ring_sets = problem.RingSets();
  for (int a = 0; a < covariance.rows(); ++a) {
    for (int b = a + 1; b < covariance.rows(); ++b) {
      const double variance =
          covariance(a, a) + covariance(b, b) - 2.0 * covariance(a, b);
      if (variance > kMaxSizeSigma * kMaxSizeSigma) continue;
      pairs.emplace_back(ring_sets[a], ring_sets[b]);
    }
  }
  return pairs;
}

}  // namespace adasfm
