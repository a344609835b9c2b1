// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "synthetic/drive.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Camera settings that change from photo to photo, and motion during the
// exposure. Images taken at the same time by two cameras have equal settings.

// Autofocus: sets focal_factor of each image by the options. The largest error
// of all images is focal_breathing_ratio.
void SetFocalFactors(SyntheticWorld* world);

// Automatic exposure: sets exposure_gain of each image. At exposure_jump_ratio
// of the images after the first the gain changes by exposure_jump_factor, up or
// down; the gain is 1, the factor or its inverse.
void SetExposureGains(SyntheticWorld* world);

// Motion blur: sets the poses of the camera from exposure_time_s / 2 before to
// exposure_time_s / 2 after each image. times_s: of the images of one camera,
// on the clock of the drive. Throws std::invalid_argument when exposures
// overlap.
void OpenShutters(const Drive& drive, const std::vector<double>& times_s,
                  SyntheticWorld* world);

// The poses of all images from duration_s / 2 before to duration_s / 2 after
// their times; empty for a duration of 0.
std::vector<ExposurePoses> PosesWithin(const Drive& drive,
                                       const std::vector<double>& times_s,
                                       double duration_s,
                                       const SyntheticWorld& world);

// Distance in the image [px] by which each keypoint on a static landmark moves
// from the beginning to the end of the exposure; empty without an exposure
// time.
std::vector<double> ComputeBlurLengths(const SyntheticWorld& world,
                                       const SyntheticImage& image);

}  // namespace adasfm
