// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/filter_edges_by_position.h"

#include <cmath>

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Directions may be off by this plus kNumSigmas of their own.
constexpr double kMaxDirectionDiscrepancyRad = DegToRad(10.0);
constexpr double kNumSigmas = 5.0;
// Lengths known from shared points may be off by this factor, both ways.
constexpr double kMaxLengthRatio = 3.0;

bool FitsPositions(const ViewGraphEdge& edge,
                   const std::optional<EdgeLength>& length,
                   const Eigen::Vector3d& direction_in_world,
                   const Eigen::Vector3d& difference) {
  const double distance = difference.norm();
  if (length.has_value()) {
    const double ratio =
        std::exp(kNumSigmas * length->log_sigma) * kMaxLengthRatio;
    if (distance > ratio * length->length ||
        distance < length->length / ratio) {
      return false;
    }
  }
  return AngleBetweenRad(difference, direction_in_world) <=
         kMaxDirectionDiscrepancyRad + kNumSigmas * edge.direction_sigma_rad;
}

}  // namespace

int FilterEdgesByPosition(
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Vector3d>& centers,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph) {
  int num_removed = 0;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || !edge.has_translation) continue;
    if (edge.source != EdgeSource::kVisual || edge.IsJoinAtRest()) continue;
    const Eigen::Vector3d direction_in_world =
        cams_from_world.at(edge.image_id2).conjugate() *
        -edge.cam2_from_cam1.translation;
    const Eigen::Vector3d difference =
        centers.at(edge.image_id2) - centers.at(edge.image_id1);
    if (!FitsPositions(
            edge, e < lengths.size() ? lengths[e] : std::optional<EdgeLength>(),
            direction_in_world, difference)) {
      edge.removal = EdgeRemoval::kTranslation;
      ++num_removed;
    }
  }
  return num_removed;
}

}  // namespace adasfm
