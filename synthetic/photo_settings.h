// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "synthetic/drive.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// What a camera sets itself from photo to photo, or does not hold still. Images
// taken at the same time by two cameras are set alike.

// Autofocus: each image's focal_factor, as the options say. The largest error
// of all images is focal_breathing_ratio.
void SetFocalFactors(SyntheticWorld* world);

// Automatic exposure: each image's exposure_gain. At exposure_jump_ratio of the
// images after the first the gain changes by exposure_jump_factor, up or down;
// it is 1, the factor or its inverse.
void SetExposureGains(SyntheticWorld* world);

// Motion blur: where the camera is from exposure_time_s / 2 before each image
// to as long after it. times_s: of the images of one camera, on the drive's
// clock. Throws std::invalid_argument where the next exposure would begin
// before.
void OpenShutters(const Drive& drive, const std::vector<double>& times_s,
                  SyntheticWorld* world);

// The poses of all images from duration_s / 2 before their times to as long
// after; empty for a duration of 0.
std::vector<ExposurePoses> PosesWithin(const Drive& drive,
                                       const std::vector<double>& times_s,
                                       double duration_s,
                                       const SyntheticWorld& world);

// How far each keypoint on what stands still moves in the picture while the
// shutter is open [px], from its first to its last place; empty without a time
// of exposure.
std::vector<double> ComputeBlurLengths(const SyntheticWorld& world,
                                       const SyntheticImage& image);

}  // namespace adasfm
