// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/relative_translation.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/parallel.h"
#include "core/so3.h"
#include "global/two_view/detect_baseline.h"
#include "global/two_view/translation_direction.h"

namespace adasfm {
namespace {

// The covariance of basis^T normal for one pixel of noise in both keypoints.
Eigen::Matrix2d NormalNoise(const TranslationProblem& problem, size_t k,
                            const Eigen::Matrix<double, 3, 2>& basis) {
  const Bearing& bearing1 = *problem.bearings.bearings1[k];
  const Bearing& bearing2 = *problem.bearings.bearings2[k];
  const Eigen::Matrix2d by_pixel1 = basis.transpose() *
                                    Hat(bearing2.direction) * problem.rotation *
                                    bearing1.jacobian;
  const Eigen::Matrix2d by_pixel2 = basis.transpose() *
                                    Hat(problem.rotation * bearing1.direction) *
                                    bearing2.jacobian;
  return by_pixel1 * by_pixel1.transpose() + by_pixel2 * by_pixel2.transpose();
}

// The larger axis of the direction's covariance: noise of the keypoints, and
// what an error of the rotation would turn it by.
double DirectionSigma(const RelativeTranslationOptions& options,
                      const TranslationProblem& problem,
                      const Eigen::Vector3d& translation) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(translation);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 2, 3> mixed = Eigen::Matrix<double, 2, 3>::Zero();
  const double squared_scale = options.loss_scale_px * options.loss_scale_px;
  double sum_weights = 0.0;
  double sum_weighted_squares = 0.0;
  for (size_t k = 0; k < problem.normals.size(); ++k) {
    const Bearing& bearing2 = *problem.bearings.bearings2[k];
    const EpipolarResidual residual =
        ComputeEpipolarResidual(*problem.bearings.bearings1[k], bearing2,
                                problem.rotation, translation);
    const double squared = residual.distance_px * residual.distance_px;
    const double weight = 1.0 / (1.0 + squared / squared_scale);
    const Eigen::Vector2d by_direction =
        residual.inverse_norm * basis.transpose() * problem.normals[k];
    const Eigen::Vector3d by_rotation =
        residual.inverse_norm *
        (problem.rotation * problem.bearings.bearings1[k]->direction)
            .cross(bearing2.direction.cross(translation));
    information += weight * by_direction * by_direction.transpose();
    noise += weight * NormalNoise(problem, k, residual.inverse_norm * basis);
    mixed += weight * by_direction * by_rotation.transpose();
    sum_weights += weight;
    sum_weighted_squares += weight * squared;
  }
  const double measured_variance =
      sum_weighted_squares / std::max(1.0, sum_weights - 2.0);
  const double variance =
      std::max(std::pow(options.keypoint_sigma_px, 2), measured_variance);
  // Noise alone makes normals too: without a baseline there is nothing else.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(
      information - measured_variance * noise);
  information = eigen.eigenvectors() *
                eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                eigen.eigenvectors().transpose();
  // The ridge stands for a radian: what nothing determines.
  const Eigen::Matrix2d inverse =
      (information + variance * Eigen::Matrix2d::Identity()).inverse();
  const Eigen::Matrix<double, 2, 3> by_rotation =
      DegToRad(options.rotation_sigma_deg) * inverse * mixed;
  const Eigen::Matrix2d covariance =
      variance * inverse + by_rotation * by_rotation.transpose();
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance)
                       .eigenvalues()(1));
}

void RefineEdge(const RelativeTranslationOptions& options,
                const TranslationProblem& problem, ViewGraphEdge* edge) {
  DirectionSearch search;
  search.max_num_iterations = options.max_num_iterations;
  search.loss_scale_px = options.loss_scale_px;
  const Eigen::Vector3d start = edge->has_translation
                                    ? edge->cam2_from_cam1.translation
                                    : Eigen::Vector3d::Zero().eval();
  const Eigen::Vector3d direction =
      EstimateTranslationDirection(search, problem, start).direction;
  edge->has_translation = false;
  if (direction.norm() == 0.0) return;
  edge->cam2_from_cam1 = Rigid3d(problem.rotation, direction);
  edge->direction_sigma_rad = DirectionSigma(options, problem, direction);
  edge->has_baseline = DetectBaseline(problem.bearings, problem.rotation,
                                      direction, options.keypoint_sigma_px);
  edge->has_translation =
      edge->has_baseline &&
      edge->direction_sigma_rad < DegToRad(options.max_direction_sigma_deg);
}

}  // namespace

bool RelativeTranslationOptions::IsValid(std::string* error) const {
  if (max_num_iterations < 1 || max_num_matches < 8) {
    *error = "max_num_iterations = " + std::to_string(max_num_iterations) +
             " must be >= 1 and max_num_matches = " +
             std::to_string(max_num_matches) + " >= 8";
    return false;
  }
  if (!(keypoint_sigma_px > 0.0) || !(loss_scale_px > 0.0) ||
      !(max_direction_sigma_deg > 0.0) || !(rotation_sigma_deg >= 0.0)) {
    *error = "keypoint_sigma_px = " + std::to_string(keypoint_sigma_px) +
             ", loss_scale_px = " + std::to_string(loss_scale_px) +
             " and max_direction_sigma_deg = " +
             std::to_string(max_direction_sigma_deg) +
             " must be > 0, rotation_sigma_deg >= 0";
    return false;
  }
  return true;
}

RelativeTranslationReport EstimateRelativeTranslations(
    const RelativeTranslationOptions& options,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const GlobalCorrespondences& correspondences, ViewGraph* graph) {
  constexpr size_t kMinNumMatches = 5;
  std::vector<char> is_refined(graph->edges.size(), 0);
  ParallelFor(options.num_threads, graph->edges.size(), [&](size_t e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || edge.source != EdgeSource::kVisual) return;
    const auto matches = correspondences.matches.find(edge.Pair());
    if (matches == correspondences.matches.end() ||
        matches->second.size() < kMinNumMatches) {
      return;
    }
    const Eigen::Quaterniond rotation =
        cams_from_world.at(edge.image_id2) *
        cams_from_world.at(edge.image_id1).conjugate();
    RefineEdge(
        options,
        BuildTranslationProblem(
            SelectEdgeBearings(correspondences.bearings.at(edge.image_id1),
                               correspondences.bearings.at(edge.image_id2),
                               matches->second, options.max_num_matches),
            rotation.toRotationMatrix()),
        &edge);
    is_refined[e] = 1;
  });
  RelativeTranslationReport report;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    if (!is_refined[e]) continue;
    ++report.num_refined;
    report.num_without_direction += !graph->edges[e].has_translation;
  }
  return report;
}

}  // namespace adasfm
