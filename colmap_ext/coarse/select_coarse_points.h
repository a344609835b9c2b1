// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "global/structure/triangulate_tracks.h"

namespace adasfm {

// Motion straight ahead leaves some images without points of a wide angle.
// Images with fewer points than this get those with the next smaller angles.
inline constexpr int kMinNumPointsPerImage = 40;

// Selects the points of the coarse model: all tracks of the wanted angle, then,
// widest first, those in an image with too few points. min_angle_deg receives
// the smallest angle that was taken. The order is kept.
std::vector<TriangulatedTrack> SelectCoarsePoints(
    const CoarseStructureOptions& options,
    std::vector<TriangulatedTrack> triangulated, double* min_angle_deg);

}  // namespace adasfm
