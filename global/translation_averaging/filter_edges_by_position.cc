// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/filter_edges_by_position.h"

#include <cmath>

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

bool FitsPositions(const PositionFilterOptions& options,
                   const ViewGraphEdge& edge,
                   const std::optional<EdgeLength>& length,
                   const Eigen::Vector3d& direction_in_world,
                   const Eigen::Vector3d& difference) {
  const double distance = difference.norm();
  if (length.has_value()) {
    const double ratio = std::exp(options.max_num_sigmas * length->log_sigma) *
                         options.max_length_ratio;
    if (distance > ratio * length->length ||
        distance < length->length / ratio) {
      return false;
    }
  }
  return AngleBetweenRad(difference, direction_in_world) <=
         DegToRad(options.max_direction_discrepancy_deg) +
             options.max_num_sigmas * edge.direction_sigma_rad;
}

}  // namespace

bool PositionFilterOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .Positive(
          {{"max_direction_discrepancy_deg", max_direction_discrepancy_deg}})
      .NotNegative({{"max_num_sigmas", max_num_sigmas}})
      .Require(max_length_ratio > 1.0, "max_length_ratio", max_length_ratio,
               "must be above 1")
      .AllHold();
}

int FilterEdgesByPosition(
    const PositionFilterOptions& options,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Vector3d>& centers,
    const std::vector<std::optional<EdgeLength>>& lengths, ViewGraph* graph) {
  int num_removed = 0;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || !edge.has_translation) continue;
    if (edge.source != EdgeSource::kVisual) continue;
    const Eigen::Vector3d direction_in_world =
        cams_from_world.at(edge.image_id2).conjugate() *
        -edge.cam2_from_cam1.translation;
    const Eigen::Vector3d difference =
        centers.at(edge.image_id2) - centers.at(edge.image_id1);
    if (!FitsPositions(
            options, edge,
            e < lengths.size() ? lengths[e] : std::optional<EdgeLength>(),
            direction_in_world, difference)) {
      edge.removal = EdgeRemoval::kTranslation;
      ++num_removed;
    }
  }
  return num_removed;
}

}  // namespace adasfm
