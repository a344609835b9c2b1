// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "global/translation_averaging/translation_averaging.h"
#include "global/view_graph/laplacian_solver.h"

namespace adasfm {

// Sigmas of directions and of relative lengths below this are taken as this.
inline constexpr double kMinPositionSigmaRatio = 2e-3;

// The data of translation averaging for one edge between nodes i and j.
struct PositionEdge {
  enum Kind {
    kFree,    // a direction
    kSoft,    // and a length from shared points
    kFixed,   // and a length in metres from sensors
    kAtRest,  // the same place, with one sigma for all axes
  };
  int i = 0;
  int j = 0;
  Kind kind = kFree;
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // of C_j - C_i
  double direction_sigma = 0.05;
  double length = 1.0;
  double length_sigma = 0.0;
  // The length serves the start only; the refinement treats it as free.
  bool is_redundant = false;
};

std::vector<std::pair<int, int>> NodePairs(
    const std::vector<PositionEdge>& edges);

// How far the ends of an edge move against each other, on the average. The
// centres themselves tell no convergence: a long drive bends as a whole long
// after neighbours stand still.
double MeanRelativeMovement(const std::vector<PositionEdge>& edges,
                            const LaplacianSolver::Vectors& before,
                            const LaplacianSolver::Vectors& after);

// The median distance of the nodes of all edges but those at rest; 1 without
// any.
double MedianDistance(const std::vector<PositionEdge>& edges,
                      const LaplacianSolver::Vectors& centers);

// Moves centres to the robust optimum of
//   | across(C_j - C_i) |^2 / (length direction_sigma)^2
//   + (along(C_j - C_i) - length)^2 / length_sigma^2
// over all edges: across and along the edge's direction; edges without a length
// keep the present one, loosely; edges at rest have length_sigma on all axes.
// Gauss-Newton with Cauchy weights, a sparse system of three unknowns per node;
// the first node becomes the origin. False when it does not converge; centres
// stay finite.
bool RefinePositions(const std::vector<PositionEdge>& edges,
                     LaplacianSolver::Vectors* centers,
                     GlobalPositions* result);

}  // namespace adasfm
