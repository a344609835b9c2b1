// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_averaging.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/so3.h"
#include "global/rotation_averaging/rotation_sdp.h"
#include "global/rotation_averaging/rotation_spanning_tree.h"
#include "global/view_graph/laplacian_solver.h"

namespace adasfm {
namespace {

using Rotations = std::vector<Eigen::Matrix3d>;

// Chatterjee and Govindu 2013: first L1 steps, then IRLS, until the mean change
// falls below kConvergenceRad.
constexpr int kMaxNumL1Iterations = 10;
constexpr int kMaxNumIrlsIterations = 100;
constexpr double kConvergenceRad = 1e-7;
// Sigmas of edges below this are taken as this, so that no edge dominates.
constexpr double kMinEdgeSigmaRad = 2e-4;

std::vector<RotationEdge> CollectEdges(const ViewGraph& graph) {
  std::vector<RotationEdge> edges;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || !edge.has_rotation) continue;
    edges.push_back({graph.IndexOf(edge.image_id1),
                     graph.IndexOf(edge.image_id2),
                     edge.cam2_from_cam1.rotation.toRotationMatrix(),
                     std::max(edge.rotation_sigma_rad, kMinEdgeSigmaRad)});
  }
  return edges;
}

// Log(R_j^T R_ij R_i) = omega_j - omega_i to first order, for R Exp(omega).
Eigen::Vector3d Residual(const RotationEdge& edge, const Rotations& rotations) {
  return LogSo3(Eigen::Quaterniond(Eigen::Matrix3d(
      rotations[edge.j].transpose() * edge.rotation * rotations[edge.i])));
}

// Where the robust loss takes over for an edge.
double LossScale(const RotationEdge& edge) {
  constexpr double kMinScaleRad = DegToRad(2.0);
  constexpr double kNumSigmas = 3.0;
  return std::max(kMinScaleRad, kNumSigmas * edge.sigma_rad);
}

// Needs no loss scale, so that starts far from the optimum compare too.
double SumOfAbsoluteErrors(const std::vector<RotationEdge>& edges,
                           const Rotations& rotations) {
  double sum = 0.0;
  for (const RotationEdge& edge : edges) {
    sum += Residual(edge, rotations).norm() / edge.sigma_rad;
  }
  return sum;
}

// The loss of one iteration: L1, or Geman-McClure that takes over at the edge's
// scale times this factor.
struct Loss {
  bool is_l1 = true;
  double scale_factor = 1.0;
};

double Weight(const Loss& loss, const RotationEdge& edge, double residual) {
  if (loss.is_l1) {
    // Residuals below this weigh alike, which keeps the system well
    // conditioned.
    constexpr double kMinResidualRad = 1e-4;
    return 1.0 / (edge.sigma_rad * std::max(residual, kMinResidualRad));
  }
  const double squared_scale = std::pow(loss.scale_factor * LossScale(edge), 2);
  return std::pow(squared_scale / (squared_scale + residual * residual), 2) /
         (edge.sigma_rad * edge.sigma_rad);
}

// One iteration; returns the mean change in radians, or a negative number when
// the system cannot be solved.
double Iterate(const Loss& loss, const std::vector<RotationEdge>& edges,
               LaplacianSolver* solver, Rotations* rotations) {
  LaplacianSolver::Vectors residuals(edges.size(), 3);
  std::vector<double> weights(edges.size());
  for (size_t e = 0; e < edges.size(); ++e) {
    residuals.row(e) = Residual(edges[e], *rotations).transpose();
    weights[e] = Weight(loss, edges[e], residuals.row(e).norm());
  }
  LaplacianSolver::Vectors changes;
  if (!solver->Solve(weights, residuals, &changes)) return -1.0;
  for (size_t i = 0; i < rotations->size(); ++i) {
    (*rotations)[i] *= ExpSo3(changes.row(i).transpose()).toRotationMatrix();
  }
  return changes.rowwise().norm().mean();
}

void StartFromSdp(const std::vector<RotationEdge>& edges, Rotations* rotations,
                  GlobalRotations* result) {
  const RotationSdpSolution solution =
      SolveRotationSdp(RotationSdpOptions(), edges, *rotations);
  result->sdp_rank = solution.rank;
  // The relaxation uses plain squares: wrong edges may have distorted the
  // solution.
  if (SumOfAbsoluteErrors(edges, solution.rotations) <
      SumOfAbsoluteErrors(edges, *rotations)) {
    *rotations = solution.rotations;
  }
  result->sdp_optimality =
      ComputeOptimality(edges, *rotations, solution.lower_bound);
}

// The cost of a node's edges when it has this rotation.
double NodeCost(const std::vector<RotationEdge>& edges,
                const std::vector<int>& node_edges, int node,
                const Eigen::Matrix3d& rotation, const Rotations& rotations) {
  double cost = 0.0;
  for (const int e : node_edges) {
    const RotationEdge& edge = edges[e];
    const Eigen::Matrix3d predicted =
        edge.j == node
            ? Eigen::Matrix3d(edge.rotation * rotations[edge.i])
            : Eigen::Matrix3d(edge.rotation.transpose() * rotations[edge.j]);
    const double squared = LogSo3(Eigen::Quaterniond(Eigen::Matrix3d(
                                      rotation.transpose() * predicted)))
                               .squaredNorm();
    const double squared_scale = std::pow(LossScale(edge), 2);
    cost += squared * squared_scale / (squared_scale + squared) /
            (edge.sigma_rad * edge.sigma_rad);
  }
  return cost;
}

// Nodes that most of their edges contradict may be in a wrong optimum: each
// takes the rotation that one of its edges predicts, when that costs less.
void RepairNodes(const std::vector<RotationEdge>& edges, Rotations* rotations) {
  std::vector<std::vector<int>> edges_of(rotations->size());
  std::vector<int> num_contradicting(rotations->size(), 0);
  for (size_t e = 0; e < edges.size(); ++e) {
    const bool contradicts =
        Residual(edges[e], *rotations).norm() > LossScale(edges[e]);
    for (const int node : {edges[e].i, edges[e].j}) {
      edges_of[node].push_back(e);
      num_contradicting[node] += contradicts;
    }
  }
  const int num_nodes = static_cast<int>(rotations->size());
  for (int node = 0; node < num_nodes; ++node) {
    const int num_edges = static_cast<int>(edges_of[node].size());
    if (2 * num_contradicting[node] <= num_edges) continue;
    double best_cost =
        NodeCost(edges, edges_of[node], node, (*rotations)[node], *rotations);
    for (const int e : edges_of[node]) {
      const RotationEdge& edge = edges[e];
      Eigen::Matrix3d candidate = edge.rotation * (*rotations)[edge.i];
      if (edge.i == node) {
        candidate = edge.rotation.transpose() * (*rotations)[edge.j];
      }
      const double cost =
          NodeCost(edges, edges_of[node], node, candidate, *rotations);
      if (cost < best_cost) {
        best_cost = cost;
        (*rotations)[node] = candidate;
      }
    }
  }
}

// L1 steps, then Geman-McClure with a scale that narrows to the loss scale:
// this converges from far away without being misled by wrong edges.
void RunIterations(const std::vector<RotationEdge>& edges,
                   LaplacianSolver* solver, Rotations* rotations,
                   GlobalRotations* result) {
  Loss loss;
  for (int k = 0; k < kMaxNumL1Iterations; ++k) {
    const double change = Iterate(loss, edges, solver, rotations);
    ++result->num_iterations;
    if (change < kConvergenceRad) break;
  }
  constexpr double kWidestFactor = 16.0;
  constexpr double kNarrowing = 0.7;
  loss.is_l1 = false;
  loss.scale_factor = kWidestFactor;
  bool was_repaired = false;
  for (int k = 0; k < kMaxNumIrlsIterations; ++k) {
    const double change = Iterate(loss, edges, solver, rotations);
    ++result->num_iterations;
    if (change < 0.0) return;
    if (loss.scale_factor == 1.0 && !was_repaired) {
      RepairNodes(edges, rotations);
      was_repaired = true;
    } else if (loss.scale_factor == 1.0 && change < kConvergenceRad) {
      result->converged = true;
      return;
    }
    loss.scale_factor = std::max(1.0, kNarrowing * loss.scale_factor);
  }
}

}  // namespace

GlobalRotations EstimateGlobalRotations(const RotationAveragingOptions& options,
                                        const ViewGraph& graph) {
  GlobalRotations result;
  const size_t num_nodes = graph.images.size();
  const std::vector<RotationEdge> edges = CollectEdges(graph);
  Rotations rotations;
  if (num_nodes == 0 ||
      !PropagateRotationsOverTree(edges, num_nodes, &rotations)) {
    return result;
  }
  if (options.use_sdp_start) StartFromSdp(edges, &rotations, &result);

  std::vector<std::pair<int, int>> node_pairs;
  for (const RotationEdge& edge : edges) {
    node_pairs.emplace_back(edge.i, edge.j);
  }
  LaplacianSolver solver(num_nodes, std::move(node_pairs));
  RunIterations(edges, &solver, &rotations, &result);

  const Eigen::Quaterniond first(rotations.front());
  for (size_t i = 0; i < num_nodes; ++i) {
    const Eigen::Quaterniond rotation =
        Eigen::Quaterniond(rotations[i]) * first.conjugate();
    if (!rotation.coeffs().allFinite()) return GlobalRotations();
    result.cams_from_world[graph.images[i]] = rotation.normalized();
  }
  result.success = true;
  return result;
}

}  // namespace adasfm
