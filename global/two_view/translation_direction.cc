// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/translation_direction.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "global/two_view/minimize_epipolar_distances.h"

namespace adasfm {
namespace {

// sum of w normal normal^T in px^-2 with Cauchy weights at t.
Eigen::Matrix3d SumNormals(const TranslationProblem& problem,
                           const Eigen::Vector3d& translation,
                           double loss_scale_px) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t k = 0; k < problem.normals.size(); ++k) {
    const EpipolarResidual residual = ComputeEpipolarResidual(
        *problem.bearings.bearings1[k], *problem.bearings.bearings2[k],
        problem.rotation, translation);
    const double weight =
        1.0 / (1.0 + std::pow(residual.distance_px / loss_scale_px, 2));
    const Eigen::Vector3d normal = residual.inverse_norm * problem.normals[k];
    sum.noalias() += weight * normal * normal.transpose();
  }
  return sum;
}

// Least eigenvectors while the loss narrows from widest_factor times its scale.
// They converge from far away, but hold the distances' denominators fixed and
// so miss the minimum, which is found from there.
EpipolarMinimum Solve(const DirectionSearch& options,
                      const TranslationProblem& problem, double widest_factor,
                      Eigen::Vector3d translation) {
  EpipolarMinimization minimization;
  minimization.max_num_iterations = options.max_num_iterations;
  minimization.loss_scale_px = options.loss_scale_px;
  minimization.hold_rotation = true;
  for (double factor = widest_factor;
       factor > 1.0 && minimization.max_num_iterations > 1; factor *= 0.5) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
        SumNormals(problem, translation, factor * options.loss_scale_px));
    const Eigen::Vector3d next = eigen.eigenvectors().col(0);
    if (!next.allFinite()) break;
    translation = next.dot(translation) < 0.0 ? -next : next;
    --minimization.max_num_iterations;
  }
  return MinimizeEpipolarDistances(minimization, problem.bearings,
                                   {problem.rotation, translation});
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
  // A right start of the search is near; the given one may be many pixels off.
  constexpr double kNear = 2.0;
  constexpr double kFar = 8.0;
  std::vector<std::pair<double, Eigen::Vector3d>> starts;
  if (options.search || start.norm() == 0.0) {
    starts.emplace_back(kNear, SearchStart(problem, options.loss_scale_px));
  }
  if (start.norm() > 0.0) starts.emplace_back(kFar, start.normalized());
  for (const auto& [widest_factor, candidate] : starts) {
    const EpipolarMinimum minimum =
        Solve(options, problem, widest_factor, candidate);
    const Eigen::Vector3d& direction = minimum.pose.translation;
    if (direction.allFinite() && minimum.cost < best.cost) {
      best.cost = minimum.cost;
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
