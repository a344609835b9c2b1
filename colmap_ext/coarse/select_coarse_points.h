// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "global/structure/triangulate_tracks.h"

namespace adasfm {

// The points whose angles the images need: all tracks of the wanted angle,
// then, widest first, those that help an image with too few points. The
// smallest angle that was taken goes to min_angle_deg. Order is kept.
std::vector<TriangulatedTrack> SelectCoarsePoints(
    const CoarseStructureOptions& options,
    std::vector<TriangulatedTrack> triangulated, double* min_angle_deg);

}  // namespace adasfm
