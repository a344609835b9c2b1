// SPDX-License-Identifier: BSD-3-Clause
#include "global/refine_relative_poses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/so3.h"
#include "global/epipolar.h"

namespace adasfm {
namespace {

using Matrix5d = Eigen::Matrix<double, 5, 5>;
using Vector5d = Eigen::Matrix<double, 5, 1>;

struct NormalEquations {
  Matrix5d matrix = Matrix5d::Zero();
  Vector5d gradient = Vector5d::Zero();
  double cost = 0.0;
  double sum_weights = 0.0;
  double sum_weighted_squares = 0.0;
};

// Gauss-Newton terms of the Cauchy-weighted distances by (rotation in camera
// 2's frame, direction in the basis of its tangent plane). The denominator of
// the distance is held fixed in each step.
NormalEquations Accumulate(const EdgeBearings& edge, double loss_scale_px,
                           const Eigen::Matrix3d& rotation,
                           const Eigen::Vector3d& translation) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(translation);
  NormalEquations sums;
  for (size_t k = 0; k < edge.bearings1.size(); ++k) {
    const EpipolarResidual residual = ComputeEpipolarResidual(
        *edge.bearings1[k], *edge.bearings2[k], rotation, translation);
    const Eigen::Vector3d& x2 = edge.bearings2[k]->direction;
    const Eigen::Vector3d x1_in_cam2 = rotation * edge.bearings1[k]->direction;
    Vector5d jacobian;
    jacobian << x1_in_cam2.cross(x2.cross(translation)),
        basis.transpose() * x1_in_cam2.cross(x2);
    jacobian *= residual.inverse_norm;
    const double squared = residual.distance_px * residual.distance_px;
    const double squared_scale = loss_scale_px * loss_scale_px;
    const double weight = 1.0 / (1.0 + squared / squared_scale);
    sums.matrix.noalias() += weight * jacobian * jacobian.transpose();
    sums.gradient += weight * residual.distance_px * jacobian;
    sums.cost += squared_scale * std::log1p(squared / squared_scale);
    sums.sum_weights += weight;
    sums.sum_weighted_squares += weight * squared;
  }
  return sums;
}

void SetSigmas(const NormalEquations& sums, double keypoint_sigma_px,
               ViewGraphEdge* edge) {
  const double freedom = std::max(1.0, sums.sum_weights - 5.0);
  const double variance = std::max(std::pow(keypoint_sigma_px, 2),
                                   sums.sum_weighted_squares / freedom);
  const Eigen::SelfAdjointEigenSolver<Matrix5d> eigen(sums.matrix);
  // What the matches do not determine is uncertain by a radian, not by
  // infinity.
  const Vector5d inverse =
      variance / (eigen.eigenvalues().array().max(0.0) + variance);
  const Matrix5d covariance = eigen.eigenvectors() * inverse.asDiagonal() *
                              eigen.eigenvectors().transpose();
  edge->rotation_sigma_rad =
      std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0);
  const Eigen::Matrix2d direction = covariance.bottomRightCorner<2, 2>();
  edge->direction_sigma_rad = std::sqrt(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(direction).eigenvalues()(
          1));
}

void RefineEdge(const RelativePoseRefinementOptions& options,
                const EdgeBearings& bearings, ViewGraphEdge* edge) {
  Eigen::Matrix3d rotation = edge->cam2_from_cam1.rotation.toRotationMatrix();
  Eigen::Vector3d translation = edge->cam2_from_cam1.translation.normalized();
  NormalEquations sums =
      Accumulate(bearings, options.loss_scale_px, rotation, translation);
  double damping = 1e-4;
  for (int i = 0; i < options.max_num_iterations; ++i) {
    Matrix5d damped = sums.matrix;
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-9 * sums.matrix.trace();
    const Vector5d step = -damped.ldlt().solve(sums.gradient);
    if (!step.allFinite()) break;
    const Eigen::Matrix3d new_rotation =
        ExpSo3(step.head<3>()).toRotationMatrix() * rotation;
    const Eigen::Vector3d new_translation =
        (translation + TangentBasis(translation) * step.tail<2>()).normalized();
    const NormalEquations new_sums = Accumulate(bearings, options.loss_scale_px,
                                                new_rotation, new_translation);
    if (new_sums.cost <= sums.cost) {
      const bool is_done = sums.cost - new_sums.cost < 1e-5 * sums.cost;
      rotation = new_rotation;
      translation = new_translation;
      sums = new_sums;
      damping = std::max(1e-9, 0.1 * damping);
      if (is_done) break;
    } else {
      damping = std::max(1e-3, 10.0 * damping);
    }
  }
  if (!rotation.allFinite() || !translation.allFinite()) return;
  if (!IsInFrontByVote(bearings.bearings1, bearings.bearings2,
                       std::vector<double>(bearings.bearings1.size(), 1.0),
                       rotation, translation)) {
    translation = -translation;
  }
  edge->cam2_from_cam1 = Rigid3d(rotation, translation);
  SetSigmas(sums, options.keypoint_sigma_px, edge);
}

}  // namespace

bool RelativePoseRefinementOptions::IsValid(std::string* error) const {
  if (max_num_iterations < 1 || max_num_matches < 8) {
    *error = "max_num_iterations = " + std::to_string(max_num_iterations) +
             " must be >= 1 and max_num_matches = " +
             std::to_string(max_num_matches) + " >= 8";
    return false;
  }
  if (!(keypoint_sigma_px > 0.0) || !(loss_scale_px > 0.0)) {
    *error = "keypoint_sigma_px = " + std::to_string(keypoint_sigma_px) +
             " and loss_scale_px = " + std::to_string(loss_scale_px) +
             " must be > 0";
    return false;
  }
  return true;
}

void RefineRelativePoses(const RelativePoseRefinementOptions& options,
                         const GlobalCorrespondences& correspondences,
                         ViewGraph* graph) {
  constexpr int kMinNumMatches = 8;
  ParallelFor(options.num_threads, graph->edges.size(), [&](size_t e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || edge.source != EdgeSource::kVisual) return;
    if (!edge.has_rotation || !edge.has_translation) return;
    const auto matches = correspondences.matches.find(edge.Pair());
    if (matches == correspondences.matches.end()) return;
    if (matches->second.size() < kMinNumMatches) return;
    RefineEdge(options,
               SelectEdgeBearings(correspondences.bearings.at(edge.image_id1),
                                  correspondences.bearings.at(edge.image_id2),
                                  matches->second, options.max_num_matches),
               &edge);
  });
}

}  // namespace adasfm
