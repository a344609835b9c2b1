// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "global/view_graph/epipolar.h"

namespace adasfm {

// Whether at least half of a pair's points move by more than keypoint noise
// explains under any rotation (the search for one starts at the given one).
// When the camera is stationary or rotates on the spot, they do not: then the
// few matches with the grossest noise, or those on passing cars, alone decide
// the direction, and agree with each other very well.
//
// The noise is measured by the epipolar distances at (rotation, translation),
// at least keypoint_sigma_px. Noise and motion are medians, so that up to 50 %
// outliers cannot decide, and three sigmas of the medians' own errors are
// tolerated. bearings: matches of a pair; |translation| = 1.
bool DetectBaseline(const EdgeBearings& bearings,
                    const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation,
                    double keypoint_sigma_px);

}  // namespace adasfm
