// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "core/bearing.h"
#include "core/rigid3d.h"
#include "core/types.h"
#include "global/structure/join_parts.h"
#include "global/view_graph/tracks.h"

namespace adasfm {

// An adjusted model with the points of all of its matches.
struct ModelPoints {
  std::map<image_t, Rigid3d> cams_from_world;
  std::map<image_t, std::vector<Bearing>> bearings;
  std::map<TrackElement, int> point_of;
  std::vector<Eigen::Vector3d> points;
};

// matches: those within the model.
ModelPoints TriangulateModel(
    const CoarseStructureOptions& options, const CoarseModel& model,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

// Observations of points of one model by images of the other, in both ways,
// from matches of these pairs, each between an image of a and one of b.
std::vector<SightAcross> FindSightsAcross(
    const ModelPoints& a, const ModelPoints& b,
    const std::vector<ImagePair>& pairs,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches);

}  // namespace adasfm
