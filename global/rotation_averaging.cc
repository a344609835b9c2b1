// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>
#include <vector>

#include "core/so3.h"
#include "global/laplacian_solver.h"
#include "global/rotation_sdp.h"

namespace adasfm {
namespace {

using Rotations = std::vector<Eigen::Matrix3d>;

std::vector<RotationEdge> CollectEdges(const RotationAveragingOptions& options,
                                       const ViewGraph& graph) {
  std::vector<RotationEdge> edges;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || !edge.has_rotation) continue;
    edges.push_back(
        {graph.IndexOf(edge.image_id1), graph.IndexOf(edge.image_id2),
         edge.cam2_from_cam1.rotation.toRotationMatrix(),
         std::max(edge.rotation_sigma_rad, options.min_rotation_sigma_rad)});
  }
  return edges;
}

// Rotations along the spanning tree of the most certain edges (Kruskal; ties in
// order of the edges), from node 0. False when the edges do not connect all.
bool StartFromSpanningTree(const std::vector<RotationEdge>& edges,
                           size_t num_nodes, Rotations* rotations) {
  std::vector<int> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&edges](int a, int b) {
    return edges[a].sigma_rad < edges[b].sigma_rad;
  });
  std::vector<int> parent(num_nodes);
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&parent](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  std::vector<std::vector<int>> tree(num_nodes);
  for (const int e : order) {
    const int a = find(edges[e].i);
    const int b = find(edges[e].j);
    if (a == b) continue;
    parent[a] = b;
    tree[edges[e].i].push_back(e);
    tree[edges[e].j].push_back(e);
  }

  rotations->assign(num_nodes, Eigen::Matrix3d::Identity());
  std::vector<bool> is_visited(num_nodes, false);
  std::vector<int> queue = {0};
  is_visited[0] = true;
  for (size_t head = 0; head < queue.size(); ++head) {
    for (const int e : tree[queue[head]]) {
      const RotationEdge& edge = edges[e];
      const bool is_forward = edge.i == queue[head];
      const int other = is_forward ? edge.j : edge.i;
      if (is_visited[other]) continue;
      is_visited[other] = true;
      if (is_forward) {
        (*rotations)[other] = edge.rotation * (*rotations)[edge.i];
      } else {
        (*rotations)[other] = edge.rotation.transpose() * (*rotations)[edge.j];
      }
      queue.push_back(other);
    }
  }
  return queue.size() == num_nodes;
}

// Log(R_j^T R_ij R_i) = omega_j - omega_i to first order, for R Exp(omega).
Eigen::Vector3d Residual(const RotationEdge& edge, const Rotations& rotations) {
  return LogSo3(Eigen::Quaterniond(Eigen::Matrix3d(
      rotations[edge.j].transpose() * edge.rotation * rotations[edge.i])));
}

// Where the robust loss takes over for an edge.
double LossScale(const RotationAveragingOptions& options,
                 const RotationEdge& edge) {
  constexpr double kNumSigmas = 3.0;
  return std::max(DegToRad(options.loss_scale_deg),
                  kNumSigmas * edge.sigma_rad);
}

// Geman-McClure, in units of the sigmas.
double RobustCost(const RotationAveragingOptions& options,
                  const std::vector<RotationEdge>& edges,
                  const Rotations& rotations) {
  double cost = 0.0;
  for (const RotationEdge& edge : edges) {
    const double squared = Residual(edge, rotations).squaredNorm();
    const double squared_scale = std::pow(LossScale(options, edge), 2);
    cost += squared * squared_scale / (squared_scale + squared) /
            (edge.sigma_rad * edge.sigma_rad);
  }
  return cost;
}

enum class Loss { kL1, kGemanMcClure };

double Weight(const RotationAveragingOptions& options, Loss loss,
              const RotationEdge& edge, double residual) {
  if (loss == Loss::kL1) {
    // Residuals below this weigh alike, which keeps the system well
    // conditioned.
    constexpr double kMinResidualRad = 1e-4;
    return 1.0 / (edge.sigma_rad * std::max(residual, kMinResidualRad));
  }
  const double squared_scale = std::pow(LossScale(options, edge), 2);
  return std::pow(squared_scale / (squared_scale + residual * residual), 2) /
         (edge.sigma_rad * edge.sigma_rad);
}

// One iteration; returns the mean change in radians, or a negative number when
// the system cannot be solved.
double Iterate(const RotationAveragingOptions& options, Loss loss,
               const std::vector<RotationEdge>& edges, LaplacianSolver* solver,
               Rotations* rotations) {
  LaplacianSolver::Vectors residuals(edges.size(), 3);
  std::vector<double> weights(edges.size());
  for (size_t e = 0; e < edges.size(); ++e) {
    residuals.row(e) = Residual(edges[e], *rotations).transpose();
    weights[e] = Weight(options, loss, edges[e], residuals.row(e).norm());
  }
  LaplacianSolver::Vectors changes;
  if (!solver->Solve(weights, residuals, &changes)) return -1.0;
  for (size_t i = 0; i < rotations->size(); ++i) {
    (*rotations)[i] *= ExpSo3(changes.row(i).transpose()).toRotationMatrix();
  }
  return changes.rowwise().norm().mean();
}

void StartFromSdp(const RotationAveragingOptions& options,
                  const std::vector<RotationEdge>& edges, Rotations* rotations,
                  GlobalRotations* result) {
  RotationSdpOptions sdp_options;
  sdp_options.min_rank = options.min_rank;
  sdp_options.max_rank = options.max_rank;
  sdp_options.max_num_sweeps = options.max_num_sdp_sweeps;
  sdp_options.tolerance = options.sdp_tolerance;
  const RotationSdpSolution solution =
      SolveRotationSdp(sdp_options, edges, *rotations);
  result->sdp_rank = solution.rank;
  result->sdp_optimality = solution.optimality;
  // The relaxation is of plain squares: wrong edges may have bent it.
  if (RobustCost(options, edges, solution.rotations) <
      RobustCost(options, edges, *rotations)) {
    *rotations = solution.rotations;
  }
}

}  // namespace

bool RotationAveragingOptions::IsValid(std::string* error) const {
  if (min_rank < 3 || max_rank < min_rank || max_rank > 12) {
    *error = "min_rank = " + std::to_string(min_rank) +
             " must be >= 3 and max_rank = " + std::to_string(max_rank) +
             " in [min_rank, 12]";
    return false;
  }
  if (max_num_sdp_sweeps < 1 || max_num_l1_iterations < 0 ||
      max_num_irls_iterations < 1) {
    *error =
        "max_num_sdp_sweeps and max_num_irls_iterations must be >= 1, "
        "max_num_l1_iterations >= 0";
    return false;
  }
  if (!(loss_scale_deg > 0.0) || !(min_rotation_sigma_rad > 0.0) ||
      !(convergence_rad > 0.0)) {
    *error = "loss_scale_deg = " + std::to_string(loss_scale_deg) +
             ", min_rotation_sigma_rad and convergence_rad must be > 0";
    return false;
  }
  return true;
}

GlobalRotations EstimateGlobalRotations(const RotationAveragingOptions& options,
                                        const ViewGraph& graph) {
  GlobalRotations result;
  const size_t num_nodes = graph.images.size();
  const std::vector<RotationEdge> edges = CollectEdges(options, graph);
  Rotations rotations;
  if (num_nodes == 0 || !StartFromSpanningTree(edges, num_nodes, &rotations)) {
    return result;
  }
  if (options.use_sdp_start) StartFromSdp(options, edges, &rotations, &result);

  std::vector<std::pair<int, int>> node_pairs;
  for (const RotationEdge& edge : edges) {
    node_pairs.emplace_back(edge.i, edge.j);
  }
  LaplacianSolver solver(num_nodes, std::move(node_pairs));
  const int num_iterations =
      options.max_num_l1_iterations + options.max_num_irls_iterations;
  int k = 0;
  while (k < num_iterations) {
    const Loss loss =
        k < options.max_num_l1_iterations ? Loss::kL1 : Loss::kGemanMcClure;
    const double change = Iterate(options, loss, edges, &solver, &rotations);
    ++result.num_iterations;
    if (change < 0.0) break;
    if (change < options.convergence_rad) {
      if (loss == Loss::kGemanMcClure) {
        result.converged = true;
        break;
      }
      k = options.max_num_l1_iterations;
      continue;
    }
    ++k;
  }

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
