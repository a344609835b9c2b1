// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/filter_edges_by_rotation.h"

#include "core/so3.h"

namespace adasfm {

int FilterEdgesByRotation(
    double max_discrepancy_deg,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    ViewGraph* graph) {
  int num_removed = 0;
  for (ViewGraphEdge& edge : graph->edges) {
    if (!edge.IsKept()) continue;
    const auto rotation1 = cams_from_world.find(edge.image_id1);
    const auto rotation2 = cams_from_world.find(edge.image_id2);
    if (rotation1 == cams_from_world.end() ||
        rotation2 == cams_from_world.end()) {
      edge.removal = EdgeRemoval::kDisconnected;
      ++num_removed;
      continue;
    }
    if (!edge.has_rotation) continue;
    const Eigen::Quaterniond cam2_from_cam1 =
        rotation2->second * rotation1->second.conjugate();
    if (AngleBetweenRad(edge.cam2_from_cam1.rotation, cam2_from_cam1) >
        DegToRad(max_discrepancy_deg)) {
      edge.removal = EdgeRemoval::kRotation;
      ++num_removed;
    }
  }
  return num_removed;
}

}  // namespace adasfm
