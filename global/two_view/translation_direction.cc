// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/translation_direction.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace adasfm {
namespace {

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

// IRLS from a start; each step is the least eigenvector. The loss narrows from
// widest_factor times its scale.
Eigen::Vector3d Solve(const TranslationProblem& problem, int num_iterations,
                      double loss_scale_px, double widest_factor,
                      Eigen::Vector3d translation) {
  double scale = widest_factor * loss_scale_px;
  for (int i = 0; i < num_iterations; ++i) {
    const Weighted sums = Accumulate(problem, translation, scale);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(sums.matrix);
    Eigen::Vector3d next = eigen.eigenvectors().col(0);
    if (!next.allFinite()) break;
    if (next.dot(translation) < 0.0) next = -next;
    const double change = (next - translation).norm();
    translation = next;
    constexpr double kSmallChange = 1e-5;
    if (scale <= loss_scale_px && change < kSmallChange) break;
    scale = std::max(loss_scale_px, 0.5 * scale);
  }
  return translation;
}

// The cost of an even subset of the matches, enough to rank hypotheses.
double SampledCost(const TranslationProblem& problem,
                   const Eigen::Vector3d& translation, double loss_scale_px) {
  constexpr size_t kNumSamples = 40;
  const size_t stride =
      std::max<size_t>(1, problem.normals.size() / kNumSamples);
  const double squared_scale = loss_scale_px * loss_scale_px;
  double cost = 0.0;
  for (size_t k = 0; k < problem.normals.size(); k += stride) {
    const double distance_px =
        ComputeEpipolarResidual(*problem.bearings.bearings1[k],
                                *problem.bearings.bearings2[k],
                                problem.rotation, translation)
            .distance_px;
    const double squared = distance_px * distance_px;
    cost += squared / (squared_scale + squared);
  }
  return cost;
}

// The best of the directions that even pairs of matches imply (two normals
// span the plane orthogonal to t).
Eigen::Vector3d SearchStart(const TranslationProblem& problem,
                            double loss_scale_px) {
  constexpr size_t kNumHypotheses = 16;
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
        SampledCost(problem, direction.normalized(), loss_scale_px);
    if (cost < best_cost) {
      best_cost = cost;
      best = direction.normalized();
    }
  }
  return best;
}

std::vector<double> Weights(const TranslationProblem& problem,
                            const Eigen::Vector3d& translation,
                            double loss_scale_px) {
  std::vector<double> weights;
  for (size_t k = 0; k < problem.normals.size(); ++k) {
    const double distance_px =
        ComputeEpipolarResidual(*problem.bearings.bearings1[k],
                                *problem.bearings.bearings2[k],
                                problem.rotation, translation)
            .distance_px;
    weights.push_back(1.0 / (1.0 + std::pow(distance_px / loss_scale_px, 2)));
  }
  return weights;
}

}  // namespace

TranslationProblem BuildTranslationProblem(EdgeBearings bearings,
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

TranslationDirection EstimateTranslationDirection(
    const DirectionSearch& options, const TranslationProblem& problem,
    const Eigen::Vector3d& start) {
  TranslationDirection best;
  if (problem.normals.size() < 2) return best;
  best.cost = std::numeric_limits<double>::infinity();
  // The searched start is near if right; the given one may be many pixels off.
  constexpr double kNear = 2.0;
  constexpr double kFar = 8.0;
  std::vector<std::pair<double, Eigen::Vector3d>> starts;
  if (options.search || start.norm() == 0.0) {
    starts.emplace_back(kNear, SearchStart(problem, options.loss_scale_px));
  }
  if (start.norm() > 0.0) starts.emplace_back(kFar, start.normalized());
  for (const auto& [widest_factor, candidate] : starts) {
    const Eigen::Vector3d direction =
        Solve(problem, options.max_num_iterations, options.loss_scale_px,
              widest_factor, candidate);
    const double cost =
        Accumulate(problem, direction, options.loss_scale_px).cost;
    if (direction.allFinite() && cost < best.cost) {
      best.cost = cost;
      best.direction = direction;
    }
  }
  if (!IsInFrontByVote(problem.bearings.bearings1, problem.bearings.bearings2,
                       Weights(problem, best.direction, options.loss_scale_px),
                       problem.rotation, best.direction)) {
    best.direction = -best.direction;
  }
  return best;
}

}  // namespace adasfm
