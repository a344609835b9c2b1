// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/translation_averaging.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/disjoint_sets.h"
#include "core/median.h"
#include "core/so3.h"
#include "global/translation_averaging/refine_positions.h"
#include "global/view_graph/laplacian_solver.h"

namespace adasfm {
namespace {

// L1 weights are bounded: residuals below this (relative to the edge's length)
// weigh alike.
constexpr double kMinResidual = 1e-3;
// Least relative sigma of lengths from shared points: neighbouring edges share
// points, so their errors are not independent.
constexpr double kMinSoftLengthSigma = 0.05;

constexpr int kMaxNumIterations = 100;
// The reweighted iterations end at this mean relative movement of the ends of
// an edge, in median edge lengths; with the second number where the refinement,
// which moves the centres further, follows.
constexpr double kMaxChange = 3e-5;
constexpr double kMaxChangeBeforeRefinement = 3e-4;

using Vectors = LaplacianSolver::Vectors;

// Where sensors connect both ends of an edge, its length from shared points
// derives from the sensors' lengths. All such lengths share errors: counted
// again, many weak ones would outvote the sensors' scale.
void MarkRedundantLengths(int num_nodes, std::vector<PositionEdge>* edges) {
  DisjointSets sets(num_nodes);
  for (const PositionEdge& edge : *edges) {
    if (edge.kind == PositionEdge::kFixed) sets.Join(edge.i, edge.j);
  }
  for (PositionEdge& edge : *edges) {
    edge.is_redundant = edge.kind == PositionEdge::kSoft &&
                        sets.Find(edge.i) == sets.Find(edge.j);
  }
}

// Of the edges with a length; 1 without any.
double MedianLength(const std::vector<PositionEdge>& edges) {
  std::vector<double> lengths;
  for (const PositionEdge& edge : edges) {
    if (edge.kind == PositionEdge::kSoft || edge.kind == PositionEdge::kFixed) {
      lengths.push_back(edge.length);
    }
  }
  const double median = lengths.empty() ? 1.0 : UpperMedian(&lengths);
  return median > 0.0 ? median : 1.0;
}

std::vector<PositionEdge> CollectEdges(
    const ViewGraph& graph,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::vector<std::optional<EdgeLength>>& soft_lengths) {
  std::vector<PositionEdge> edges;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = graph.edges[e];
    if (!edge.IsKept() || !edge.has_translation) continue;
    PositionEdge collected;
    collected.i = graph.IndexOf(edge.image_id1);
    collected.j = graph.IndexOf(edge.image_id2);
    // C_j - C_i = -R_j^T t_ij.
    const Eigen::Vector3d translation_in_world =
        cams_from_world.at(edge.image_id2).conjugate() *
        -edge.cam2_from_cam1.translation;
    const double norm = translation_in_world.norm();
    if (norm > 0.0) collected.direction = translation_in_world / norm;
    collected.direction_sigma =
        std::max(edge.direction_sigma_rad, kMinPositionSigmaRatio);
    if (edge.IsJoinAtRest()) {
      collected.kind = PositionEdge::kAtRest;
      collected.length = 0.0;
    } else if (edge.length_m.has_value()) {
      constexpr double kFallbackRatio = 0.05;
      collected.kind = PositionEdge::kFixed;
      collected.length = *edge.length_m;
      collected.length_sigma = std::isfinite(edge.length_sigma_m)
                                   ? edge.length_sigma_m
                                   : kFallbackRatio * collected.length;
    } else if (e < soft_lengths.size() && soft_lengths[e].has_value()) {
      collected.kind = PositionEdge::kSoft;
      collected.length = soft_lengths[e]->length;
      collected.length_sigma =
          collected.length *
          std::max(soft_lengths[e]->log_sigma, kMinSoftLengthSigma);
    }
    edges.push_back(collected);
  }
  MarkRedundantLengths(graph.images.size(), &edges);
  const double rest_sigma = kRestSigmaRatio * MedianLength(edges);
  for (PositionEdge& edge : edges) {
    if (edge.kind == PositionEdge::kAtRest) edge.length_sigma = rest_sigma;
  }
  return edges;
}

bool IsConnected(const std::vector<PositionEdge>& edges, int num_nodes) {
  std::vector<std::vector<int>> neighbours(num_nodes);
  for (const PositionEdge& edge : edges) {
    neighbours[edge.i].push_back(edge.j);
    neighbours[edge.j].push_back(edge.i);
  }
  std::vector<bool> is_visited(num_nodes, false);
  std::vector<int> stack = {0};
  is_visited[0] = true;
  int count = 1;
  while (!stack.empty()) {
    const int i = stack.back();
    stack.pop_back();
    for (const int j : neighbours[i]) {
      if (is_visited[j]) continue;
      is_visited[j] = true;
      ++count;
      stack.push_back(j);
    }
  }
  return count == num_nodes;
}

class PositionSolver {
 public:
  PositionSolver(const TranslationAveragingOptions& options,
                 const std::vector<PositionEdge>& edges, int num_nodes)
      : options_(options),
        edges_(edges),
        solver_(num_nodes, NodePairs(edges)),
        unit_(MedianLength(edges)) {}

  // IRLS until the centres converge. hold_soft: lengths of soft edges are fixed
  // too. Adds the number of iterations to the result.
  bool Run(bool hold_soft, Vectors* centers, GlobalPositions* result) {
    const double max_change =
        options_.refine ? kMaxChangeBeforeRefinement : kMaxChange;
    result->converged = false;
    for (int k = 0; k < kMaxNumIterations; ++k) {
      Vectors next;
      if (!Iterate(hold_soft, *centers, &next)) return false;
      result->last_change =
          centers->rows() == next.rows()
              ? MeanRelativeMovement(edges_, *centers, next) / unit_
              : std::numeric_limits<double>::infinity();
      *centers = next;
      ++result->num_iterations;
      if (result->last_change < max_change) {
        result->converged = true;
        break;
      }
    }
    return true;
  }

 private:
  // One reweighted solve from centers (none yet: the lengths alone).
  bool Iterate(bool hold_soft, const Vectors& centers, Vectors* next) {
    std::vector<double> weights(edges_.size());
    Vectors differences(edges_.size(), 3);
    const bool has_centers = centers.rows() > 0;
    for (size_t e = 0; e < edges_.size(); ++e) {
      const PositionEdge& edge = edges_[e];
      const bool is_held =
          edge.kind == PositionEdge::kFixed ||
          edge.kind == PositionEdge::kAtRest ||
          (edge.kind == PositionEdge::kSoft && (hold_soft || !has_centers));
      Eigen::Vector3d difference = Eigen::Vector3d::Zero();
      if (has_centers) {
        difference = (centers.row(edge.j) - centers.row(edge.i)).transpose();
      }
      double length = edge.length;
      if (!is_held) length = FreeLength(edge, difference);
      differences.row(e) = length * edge.direction.transpose();
      // s_ij = 0: the centres lie in the opposite direction. The edge keeps
      // only a trace of its weight, so that the system stays regular.
      constexpr double kSilent = 1e-6;
      const double scale = std::max(length, 1e-2 * unit_);
      double residual = 1.0;
      if (has_centers) {
        residual = (difference - length * edge.direction).norm() / scale;
      }
      // One sigma for all three axes. With that of its direction alone, a free
      // edge in a wrong direction would outvote twenty edges whose lengths are
      // known to 5 %.
      const double sigma =
          std::max(edge.direction_sigma,
                   is_held ? edge.length_sigma / scale : kMinSoftLengthSigma);
      const double weight =
          1.0 / (sigma * std::max(residual, kMinResidual) * scale * scale);
      const bool is_silent = !is_held && length == 0.0;
      weights[e] = is_silent ? kSilent * weight : weight;
    }
    return solver_.Solve(weights, differences, next);
  }

  // 1 / s_ij at the best s_ij >= 0 for the present centres, which minimises
  // | s_ij difference - direction |: |difference|^2 / (direction . difference).
  double FreeLength(const PositionEdge& edge,
                    const Eigen::Vector3d& difference) const {
    const double along = edge.direction.dot(difference);
    const double squared = difference.squaredNorm();
    if (squared == 0.0) return unit_;
    if (!(along > 1e-3 * std::sqrt(squared))) return 0.0;
    return squared / along;
  }

  const TranslationAveragingOptions& options_;
  const std::vector<PositionEdge>& edges_;
  LaplacianSolver solver_;
  const double unit_;
};

// Without metres the median length of the edges becomes 1.
void NormalizeScale(const std::vector<PositionEdge>& edges, Vectors* centers) {
  const double median = MedianDistance(edges, *centers);
  if (median > 0.0) *centers /= median;
}

}  // namespace

GlobalPositions EstimateGlobalPositions(
    const TranslationAveragingOptions& options, const ViewGraph& graph,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::vector<std::optional<EdgeLength>>& soft_lengths,
    const std::map<image_t, Eigen::Vector3d>& initial_centers) {
  GlobalPositions result;
  const int num_nodes = graph.images.size();
  const std::vector<PositionEdge> edges =
      CollectEdges(graph, cams_from_world, soft_lengths);
  if (num_nodes == 0 || !IsConnected(edges, num_nodes)) return result;
  result.metric = std::any_of(edges.begin(), edges.end(), [](const auto& edge) {
    return edge.kind == PositionEdge::kFixed;
  });

  Vectors centers;
  if (initial_centers.size() == graph.images.size()) {
    centers.resize(num_nodes, 3);
    for (int i = 0; i < num_nodes; ++i) {
      centers.row(i) = initial_centers.at(graph.images[i]).transpose();
    }
  }
  PositionSolver solver(options, edges, num_nodes);
  if (centers.rows() == 0 && !solver.Run(true, &centers, &result)) {
    return result;
  }
  // Without metres, freeing all lengths at once lets weak parts of the graph
  // shrink; the refinement frees them within their sigmas.
  if ((result.metric || !options.refine) &&
      !solver.Run(false, &centers, &result)) {
    return result;
  }
  if (options.refine) {
    const bool converged = RefinePositions(edges, &centers, &result);
    result.converged = converged;
  }
  if (!centers.allFinite()) return result;
  if (!result.metric) NormalizeScale(edges, &centers);
  for (int i = 0; i < num_nodes; ++i) {
    result.centers[graph.images[i]] =
        (centers.row(i) - centers.row(0)).transpose();
  }
  result.success = true;
  return result;
}

}  // namespace adasfm
