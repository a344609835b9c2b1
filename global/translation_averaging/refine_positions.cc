// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/refine_positions.h"

#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "global/view_graph/node_equations.h"

namespace adasfm {
namespace {

using Vectors = LaplacianSolver::Vectors;

// The information matrix of C_j - C_i and its target.
struct EdgeTerm {
  Eigen::Matrix3d information;
  Eigen::Vector3d target;
};

EdgeTerm ComputeTerm(const PositionEdge& edge,
                     const Eigen::Vector3d& difference, double min_length) {
  // An edge without a length keeps the present one, with this relative sigma,
  // which damps the step and fixes the scale.
  constexpr double kFreeLengthSigma = 1.0;
  // Where the Cauchy loss takes over, in sigmas.
  constexpr double kLossScale = 2.0;
  const double along = edge.direction.dot(difference);
  const bool is_free = edge.kind == PositionEdge::kFree || edge.is_redundant;
  const double length =
      std::max(min_length, is_free ? std::abs(along) : edge.length);
  const double across_sigma = length * edge.direction_sigma;
  double along_sigma = is_free ? length * kFreeLengthSigma : edge.length_sigma;
  along_sigma = std::max(along_sigma, kMinPositionSigmaRatio * length);
  const Eigen::Matrix3d projection =
      edge.direction * edge.direction.transpose();
  EdgeTerm term;
  if (edge.kind == PositionEdge::kAtRest) {
    term.target.setZero();
    term.information =
        Eigen::Matrix3d::Identity() / (edge.length_sigma * edge.length_sigma);
  } else {
    term.target = (is_free ? length : edge.length) * edge.direction;
    term.information = (Eigen::Matrix3d::Identity() - projection) /
                           (across_sigma * across_sigma) +
                       projection / (along_sigma * along_sigma);
  }
  const Eigen::Vector3d residual = difference - term.target;
  const double squared = residual.dot(term.information * residual);
  term.information /= 1.0 + squared / std::pow(kLossScale, 2);
  return term;
}

}  // namespace

std::vector<std::pair<int, int>> NodePairs(
    const std::vector<PositionEdge>& edges) {
  std::vector<std::pair<int, int>> pairs;
  for (const PositionEdge& edge : edges) pairs.emplace_back(edge.i, edge.j);
  return pairs;
}

double MeanRelativeMovement(const std::vector<PositionEdge>& edges,
                            const Vectors& before, const Vectors& after) {
  double sum = 0.0;
  for (const PositionEdge& edge : edges) {
    sum += (after.row(edge.j) - after.row(edge.i) - before.row(edge.j) +
            before.row(edge.i))
               .norm();
  }
  return sum / edges.size();
}

double MedianDistance(const std::vector<PositionEdge>& edges,
                      const Vectors& centers) {
  std::vector<double> distances;
  for (const PositionEdge& edge : edges) {
    if (edge.kind == PositionEdge::kAtRest) continue;
    distances.push_back((centers.row(edge.j) - centers.row(edge.i)).norm());
  }
  return distances.empty() ? 1.0 : UpperMedian(&distances);
}

bool RefinePositions(const std::vector<PositionEdge>& edges, Vectors* centers,
                     GlobalPositions* result) {
  const int num_nodes = centers->rows();
  if (num_nodes < 2) return true;
  const double unit = MedianDistance(edges, *centers);
  if (!(unit > 0.0)) return false;

  constexpr int kMaxNumIterations = 100;
  // Mean relative movement of the ends of an edge, in median edge lengths.
  constexpr double kMaxChange = 2e-5;
  NodeEquations<3> equations(num_nodes, NodePairs(edges));
  for (int k = 0; k < kMaxNumIterations; ++k) {
    equations.Clear();
    for (const PositionEdge& edge : edges) {
      const Eigen::Vector3d difference =
          (centers->row(edge.j) - centers->row(edge.i)).transpose();
      const EdgeTerm term = ComputeTerm(edge, difference, 0.02 * unit);
      equations.Add(edge.i, edge.j, term.information, term.target);
    }
    Vectors next;
    if (!equations.Solve(0.0, &next)) return false;
    result->last_change = MeanRelativeMovement(edges, *centers, next) / unit;
    *centers = next;
    ++result->num_iterations;
    if (result->last_change < kMaxChange) return true;
  }
  return false;
}

}  // namespace adasfm
