// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>

#include "core/types.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Removes edges with angle(R_ij^T R_j R_i^T) > max_discrepancy_deg (eps_R).
// Edges to images without a rotation are removed as disconnected. Returns how
// many were removed.
int FilterEdgesByRotation(
    double max_discrepancy_deg,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    ViewGraph* graph);

}  // namespace adasfm
