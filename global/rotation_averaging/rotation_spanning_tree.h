// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "global/rotation_averaging/rotation_sdp.h"

namespace adasfm {

// Rotations along the spanning tree of the most certain edges, from node 0,
// which stays the identity. False when the edges do not connect all nodes.
bool PropagateRotationsOverTree(const std::vector<RotationEdge>& edges,
                                size_t num_nodes,
                                std::vector<Eigen::Matrix3d>* rotations);

}  // namespace adasfm
