// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace adasfm {

// An edge of rotation averaging between nodes 0 ... n - 1: R_j ~ rotation R_i.
struct RotationEdge {
  int i = 0;
  int j = 0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double sigma_rad = 0.01;
};

struct RotationSdpOptions {
  // Where the staircase ends without a certificate. It begins at 3.
  int max_rank = 6;
  int max_num_sweeps = 100;
  double tolerance = 1e-6;
};

struct RotationSdpSolution {
  std::vector<Eigen::Matrix3d> rotations;
  int rank = 0;
  // Of the relaxed solution, sum of w |Y_j - R_ij Y_i|^2, with the weights
  // w = (smallest sigma / sigma)^2.
  double cost = 0.0;
  // No rotations cost less; proven by a factorisation (rotation_certificate.h).
  double lower_bound = 0.0;
  // lower_bound over the cost of `rotations`, in [0, 1]; 1 when that cost is
  // round-off.
  double optimality = 0.0;
};

// min sum |R_j - R_ij R_i|^2 / (2 sigma^2) relaxed to matrices Y_i of 3 x rank
// with orthonormal rows (Chen et al. 2021): block coordinate descent sets Y_i
// to the polar factor of the weighted sum of its neighbours' predictions. While
// the certificate matrix has a negative eigenvalue, the rank grows by one along
// its eigenvector (the staircase). The result is rounded to rotations.
RotationSdpSolution SolveRotationSdp(const RotationSdpOptions& options,
                                     const std::vector<RotationEdge>& edges,
                                     const std::vector<Eigen::Matrix3d>& start);

// lower_bound over the cost of these rotations, in [0, 1]; 1 when that cost is
// round-off.
double ComputeOptimality(const std::vector<RotationEdge>& edges,
                         const std::vector<Eigen::Matrix3d>& rotations,
                         double lower_bound);

}  // namespace adasfm
