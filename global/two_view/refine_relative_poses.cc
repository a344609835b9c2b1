// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/refine_relative_poses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/so3.h"
#include "global/two_view/detect_baseline.h"
#include "global/two_view/translation_direction.h"
#include "global/view_graph/epipolar.h"

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
    const Vector5d jacobian =
        EpipolarJacobian(*edge.bearings1[k], *edge.bearings2[k], rotation,
                         translation, basis, residual.inverse_norm);
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

// A prediction in the units of the cost: px^2 per rad^2.
struct WeightedPrediction {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

// A local optimum.
struct RelativePose {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  NormalEquations sums;
};

void Evaluate(const EdgeBearings& bearings, double loss_scale_px,
              const WeightedPrediction& prediction, RelativePose* pose) {
  pose->sums =
      Accumulate(bearings, loss_scale_px, pose->rotation, pose->translation);
  const Eigen::Vector3d error = LogSo3(Eigen::Quaterniond(
      Eigen::Matrix3d(pose->rotation * prediction.rotation.transpose())));
  pose->sums.matrix.topLeftCorner<3, 3>() += prediction.information;
  pose->sums.gradient.head<3>() += prediction.information * error;
  pose->sums.cost += error.dot(prediction.information * error);
}

RelativePose Descend(const RelativePoseRefinementOptions& options,
                     const EdgeBearings& bearings,
                     const WeightedPrediction& prediction, RelativePose pose) {
  Evaluate(bearings, options.loss_scale_px, prediction, &pose);
  double damping = 1e-4;
  for (int i = 0; i < options.max_num_iterations; ++i) {
    Matrix5d damped = pose.sums.matrix;
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-9 * damped.trace();
    const Vector5d step = -damped.ldlt().solve(pose.sums.gradient);
    if (!step.allFinite()) break;
    RelativePose next;
    next.rotation = ExpSo3(step.head<3>()).toRotationMatrix() * pose.rotation;
    next.translation =
        (pose.translation + TangentBasis(pose.translation) * step.tail<2>())
            .normalized();
    Evaluate(bearings, options.loss_scale_px, prediction, &next);
    if (next.sums.cost <= pose.sums.cost) {
      const bool is_done =
          pose.sums.cost - next.sums.cost < 1e-5 * pose.sums.cost;
      pose = next;
      damping = std::max(1e-9, 0.1 * damping);
      if (is_done) break;
    } else {
      damping = std::max(1e-3, 10.0 * damping);
    }
  }
  return pose;
}

// The variance of a distance in px^2.
double Variance(const NormalEquations& sums, double keypoint_sigma_px) {
  return std::max(
      keypoint_sigma_px * keypoint_sigma_px,
      sums.sum_weighted_squares / std::max(1.0, sums.sum_weights - 5.0));
}

void SetSigmas(const RelativePose& pose, double variance, ViewGraphEdge* edge) {
  const Eigen::SelfAdjointEigenSolver<Matrix5d> eigen(pose.sums.matrix);
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

// The optimum that takes the prediction into account.
RelativePose DescendFromPrediction(const RelativePoseRefinementOptions& options,
                                   const EdgeBearings& bearings,
                                   const RotationPrediction& prediction,
                                   double variance,
                                   const Eigen::Vector3d& direction) {
  WeightedPrediction weighted;
  weighted.rotation = prediction.cam2_from_cam1.toRotationMatrix();
  weighted.information = variance * prediction.covariance.inverse();
  DirectionSearch search;
  search.loss_scale_px = options.loss_scale_px;
  search.search = false;
  search.max_num_iterations = 6;
  RelativePose pose;
  pose.rotation = weighted.rotation;
  pose.translation =
      EstimateTranslationDirection(
          search, BuildTranslationProblem(bearings, pose.rotation), direction)
          .direction;
  return Descend(options, bearings, weighted, pose);
}

void RefineEdge(const RelativePoseRefinementOptions& options,
                const EdgeBearings& bearings,
                const std::optional<RotationPrediction>& prediction,
                ViewGraphEdge* edge) {
  RelativePose pose;
  pose.rotation = edge->cam2_from_cam1.rotation.toRotationMatrix();
  pose.translation = edge->cam2_from_cam1.translation.normalized();
  pose = Descend(options, bearings, WeightedPrediction(), pose);
  const double variance = Variance(pose.sums, options.keypoint_sigma_px);
  if (prediction.has_value()) {
    const RelativePose predicted = DescendFromPrediction(
        options, bearings, *prediction, variance, pose.translation);
    if (predicted.sums.cost <
        pose.sums.cost + options.max_prediction_cost * variance) {
      pose = predicted;
    }
  }
  if (!pose.rotation.allFinite() || !pose.translation.allFinite()) return;
  if (!IsInFrontByVote(bearings.bearings1, bearings.bearings2,
                       std::vector<double>(bearings.bearings1.size(), 1.0),
                       pose.rotation, pose.translation)) {
    pose.translation = -pose.translation;
  }
  edge->cam2_from_cam1 = Rigid3d(pose.rotation, pose.translation);
  edge->has_baseline = DetectBaseline(bearings, pose.rotation, pose.translation,
                                      options.keypoint_sigma_px);
  SetSigmas(pose, variance, edge);
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

void RefineRelativePoses(
    const RelativePoseRefinementOptions& options,
    const GlobalCorrespondences& correspondences,
    const std::vector<std::optional<RotationPrediction>>& predictions,
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
               predictions.empty() ? std::nullopt : predictions.at(e), &edge);
  });
}

}  // namespace adasfm
