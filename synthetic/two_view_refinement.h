// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/bearing.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// The distance of a match from the epipolar geometry, in px of both images
// (Sampson 1982); infinity for a match with negative depth.
double ComputeSampsonErrorPx(const Bearing& bearing1, const Bearing& bearing2,
                             const Rigid3d& cam2_from_cam1);

// A match that is farther from the geometry is no inlier, as in COLMAP.
inline constexpr double kMaxEpipolarErrorPx = 4.0;

// Gauss-Newton on the Sampson errors, from a start near the solution, with a
// robust weight beyond about 2 px. Derivatives are numeric, so as not to share
// a mistake with the estimators under test. The translation has length one.
Rigid3d RefineTwoViewPose(const std::vector<Bearing>& bearings1,
                          const std::vector<Bearing>& bearings2,
                          const std::vector<FeatureMatch>& matches,
                          const Rigid3d& initial_cam2_from_cam1);

}  // namespace adasfm
