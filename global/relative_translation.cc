// SPDX-License-Identifier: BSD-3-Clause
#include "global/relative_translation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/parallel.h"
#include "core/so3.h"
#include "global/epipolar.h"

namespace adasfm {
namespace {

// Everything of one edge that does not change with t: the constraint of match k
// is normals[k] . t = 0, normals = R x1 x x2.
struct TranslationProblem {
  EdgeBearings bearings;
  Eigen::Matrix3d rotation;
  std::vector<Eigen::Vector3d> normals;
};

TranslationProblem BuildProblem(EdgeBearings bearings,
                                const Eigen::Matrix3d& rotation) {
  TranslationProblem problem;
  problem.bearings = std::move(bearings);
  problem.rotation = rotation;
  for (size_t k = 0; k < problem.bearings.bearings1.size(); ++k) {
    problem.normals.push_back(
        (rotation * problem.bearings.bearings1[k]->direction)
            .cross(problem.bearings.bearings2[k]->direction));
  }
  return problem;
}

struct Weighted {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  double cost = 0.0;
  double sum_weights = 0.0;
  double sum_weighted_squares = 0.0;
};

// sum of w normal normal^T in px^-2 with Cauchy weights at t.
Weighted Accumulate(const TranslationProblem& problem,
                    const Eigen::Vector3d& translation, double loss_scale_px) {
  Weighted sums;
  const double squared_scale = loss_scale_px * loss_scale_px;
  for (size_t k = 0; k < problem.normals.size(); ++k) {
    const EpipolarResidual residual = ComputeEpipolarResidual(
        *problem.bearings.bearings1[k], *problem.bearings.bearings2[k],
        problem.rotation, translation);
    const double squared = residual.distance_px * residual.distance_px;
    const double weight = 1.0 / (1.0 + squared / squared_scale);
    const Eigen::Vector3d normal = residual.inverse_norm * problem.normals[k];
    sums.matrix.noalias() += weight * normal * normal.transpose();
    sums.cost += squared_scale * std::log1p(squared / squared_scale);
    sums.sum_weights += weight;
    sums.sum_weighted_squares += weight * squared;
  }
  return sums;
}

// IRLS from a start; each step is the least eigenvector.
Eigen::Vector3d Solve(const TranslationProblem& problem, int num_iterations,
                      double loss_scale_px, Eigen::Vector3d translation) {
  // Wide losses first: the start may be many pixels off.
  double scale = 8.0 * loss_scale_px;
  for (int i = 0; i < num_iterations; ++i) {
    const Weighted sums = Accumulate(problem, translation, scale);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(sums.matrix);
    Eigen::Vector3d next = eigen.eigenvectors().col(0);
    if (!next.allFinite()) break;
    if (next.dot(translation) < 0.0) next = -next;
    const double change = (next - translation).norm();
    translation = next;
    if (scale <= loss_scale_px && change < 1e-6) break;
    scale = std::max(loss_scale_px, 0.5 * scale);
  }
  return translation;
}

// The best of the directions that even pairs of matches imply (two normals
// span the plane orthogonal to t).
Eigen::Vector3d SearchStart(const TranslationProblem& problem,
                            double loss_scale_px) {
  constexpr size_t kNumHypotheses = 24;
  const size_t count = problem.normals.size();
  Eigen::Vector3d best = Eigen::Vector3d::UnitZ();
  double best_cost = std::numeric_limits<double>::infinity();
  for (size_t h = 0; h < kNumHypotheses; ++h) {
    const size_t a = h * count / kNumHypotheses;
    const size_t b = (a + 1 + (h * 7 + count / 3) % (count - 1)) % count;
    const Eigen::Vector3d direction =
        problem.normals[a].cross(problem.normals[b]);
    if (!(direction.norm() > 1e-12)) continue;
    const double cost =
        Accumulate(problem, direction.normalized(), loss_scale_px).cost;
    if (cost < best_cost) {
      best_cost = cost;
      best = direction.normalized();
    }
  }
  return best;
}

// The larger axis of the direction's covariance: noise of the keypoints, and
// what an error of the rotation would turn it by.
double DirectionSigma(const RelativeTranslationOptions& options,
                      const TranslationProblem& problem,
                      const Eigen::Vector3d& translation) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(translation);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
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
    mixed += weight * by_direction * by_rotation.transpose();
    sum_weights += weight;
    sum_weighted_squares += weight * squared;
  }
  const double variance =
      std::max(std::pow(options.keypoint_sigma_px, 2),
               sum_weighted_squares / std::max(1.0, sum_weights - 2.0));
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
  std::vector<Eigen::Vector3d> starts = {
      SearchStart(problem, options.loss_scale_px)};
  const Eigen::Vector3d& old = edge->cam2_from_cam1.translation;
  if (edge->has_translation && old.norm() > 0.0) {
    starts.push_back(old.normalized());
  }
  double best_cost = std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& start : starts) {
    const Eigen::Vector3d translation = Solve(
        problem, options.max_num_iterations, options.loss_scale_px, start);
    const double cost =
        Accumulate(problem, translation, options.loss_scale_px).cost;
    if (cost < best_cost) {
      best_cost = cost;
      best = translation;
    }
  }
  if (!best.allFinite() || best.norm() == 0.0) {
    edge->has_translation = false;
    return;
  }
  std::vector<double> weights;
  for (size_t k = 0; k < problem.normals.size(); ++k) {
    const double distance_px =
        ComputeEpipolarResidual(*problem.bearings.bearings1[k],
                                *problem.bearings.bearings2[k],
                                problem.rotation, best)
            .distance_px;
    weights.push_back(1.0 /
                      (1.0 + std::pow(distance_px / options.loss_scale_px, 2)));
  }
  if (!IsInFrontByVote(problem.bearings.bearings1, problem.bearings.bearings2,
                       weights, problem.rotation, best)) {
    best = -best;
  }
  edge->cam2_from_cam1 = Rigid3d(problem.rotation, best);
  edge->direction_sigma_rad = DirectionSigma(options, problem, best);
  edge->has_translation =
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
    RefineEdge(options,
               BuildProblem(SelectEdgeBearings(
                                correspondences.bearings.at(edge.image_id1),
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
