// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "colmap_ext/block_cholesky.h"
#include "colmap_ext/bundle_data.h"

namespace adasfm {

// Where the robust losses take over, in sigmas; <= 0: plain squares.
struct BundleLosses {
  double reprojection = 2.0;  // soft L1
  double prior = 3.0;         // Cauchy
};

// The cost's normal equations at the data's poses and points, with the points
// eliminated. With J = [A B] (poses, points), U = A^T A, V = B^T B, W = A^T B:
//   (U - W V^-1 W^T) dc = -(g_c - W V^-1 g_p),  dp = -V^-1 (g_p + W^T dc)
// where U and V carry the damping. Robust losses act through weights rho'.
class ReducedCameraSystem {
 public:
  ReducedCameraSystem(const BundleData& data, const BundleLosses& losses,
                      int num_threads);

  // Half the sum of rho(|r|^2).
  double ComputeCost() const;
  // Evaluates residuals and Jacobians; returns the cost.
  double Linearize();
  // The reduced system for damping diag(J^T J) / radius.
  void Reduce(double radius);
  const BlockMatrix& Matrix() const { return matrix_; }
  const std::vector<Vector6d>& RightSide() const { return right_side_; }
  // The points' step that belongs to a step of the poses, and by how much the
  // linearised cost falls with both.
  std::vector<Eigen::Vector3d> BackSubstitute(
      const std::vector<Vector6d>& pose_step, double* model_decrease) const;

  // The position of each free pose in the data's images.
  const std::vector<int>& FreeImages() const { return free_images_; }

 private:
  using Matrix63d = Eigen::Matrix<double, 6, 3>;
  struct ObservationTerms {
    Matrix63d pose_from_point;  // W
    Eigen::Matrix3d point;      // share in V
    Eigen::Vector3d gradient;   // share in g_p
  };
  struct PriorTerms {
    Matrix6d block11, block12, block22;
    Vector6d gradient1, gradient2;
  };

  void BuildStructure();
  double LinearizeImage(int image);
  void LinearizePriors();
  void ReduceRow(int row, double radius);
  void AddPriors();
  Matrix6d& Block(int row, int column);

  const BundleData& data_;
  const BundleLosses losses_;
  const int num_threads_;
  std::vector<int> free_images_;
  std::vector<int> row_of_image_;  // -1: constant or unused
  // Observations of each image and range of each point's observations.
  std::vector<std::vector<int>> observations_of_image_;
  std::vector<int> first_observation_of_point_;

  std::vector<ObservationTerms> terms_;
  std::vector<PriorTerms> prior_terms_;
  double prior_cost_ = 0.0;
  std::vector<Matrix6d> pose_blocks_;     // U without priors
  std::vector<Vector6d> pose_gradients_;  // g_c, with priors
  std::vector<Vector6d> pose_diagonals_;  // of U, with priors
  std::vector<Vector6d> pose_damping_;
  std::vector<Eigen::Matrix3d> point_inverses_;  // V^-1 with damping
  std::vector<Eigen::Vector3d> point_gradients_;
  std::vector<Eigen::Vector3d> point_damping_;
  BlockMatrix matrix_;
  std::vector<Vector6d> right_side_;
};

}  // namespace adasfm
