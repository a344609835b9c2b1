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

// What: parts of a model without wheels that an accelerometer puts elsewhere.
// Look-alikes that face the same way hold a part to a false place, and no
// rotation contradicts; but nothing moves by 30 m in half a second.
//
// Inputs: motions of consecutive images in order of time; priors, whose
// rotations lead over images without a pose; poses in the model's unit.
// Method. Between images in a row that have a pose, the velocities that both
// neighbouring intervals tell must differ as the IMU integrated (with gravity
// as the median of all). An interval across which both neighbours' velocities
// miss the next image by one and the same jump, of more than 2 m and ten times
// what is usual in this model for the time between, is a break; an image that
// is wrong by itself gives no two equal jumps. Runs of images between breaks
// whose jumps sum up to nothing lie in one place.
// Returns the images of each place but that of most images, the largest first;
// nothing where the accelerometer does not tell the size
// (EstimateInertialScale) and for places of fewer than 3 images.
std::vector<std::set<image_t>> FindPartsByInertia(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::map<image_t, Rigid3d>& cams_from_world);

}  // namespace adasfm
