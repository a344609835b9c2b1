// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// Finds parts of a model without wheels whose place contradicts the
// accelerometer. Aliased pairs that face the same way can fix a part at a false
// place that no rotation contradicts; but nothing moves by 30 m in half a
// second.
//
// motions: of consecutive images in order of time. priors: their rotations are
// used across images without a pose. cams_from_world: in the model's unit.
//
// For consecutive images with a pose, the velocities of both neighbouring
// intervals must differ as the IMU integrated (with gravity as the median of
// all). An interval is a break if the velocities of both neighbours miss the
// next image by the same jump, of more than 2 m and ten times what is usual in
// this model for the time between. An image that is wrong by itself gives no
// two equal jumps. Runs of images between breaks whose jumps sum up to zero lie
// in one place.
//
// Returns the images of each place but that of most images, the largest first;
// nothing where the accelerometer does not determine the scale
// (EstimateInertialScale) and for places of fewer than 3 images.
std::vector<std::set<image_t>> FindPartsByInertia(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::map<image_t, Rigid3d>& cams_from_world);

}  // namespace adasfm
