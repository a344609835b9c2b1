// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "global/view_graph/epipolar.h"

namespace adasfm {

// Whether half of a pair's points move by more than the noise of the keypoints
// would let them, whatever the rotation (the search for one starts at the given
// one). At a standstill, and when turning on the
// spot, they do not: then the few of grossest noise, or those on passing cars,
// decide the direction alone, and agree with each other very well.
//
// The noise is measured by the epipolar distances at (rotation, translation),
// at least keypoint_sigma_px; medians of both, so that neither takes heed of
// less than half of the matches. Three sigmas of the medians' own errors are
// granted. bearings: matches of a pair; |translation| = 1.
bool DetectBaseline(const EdgeBearings& bearings,
                    const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation,
                    double keypoint_sigma_px);

}  // namespace adasfm
