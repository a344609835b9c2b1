// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>

#include "colmap_ext/host/pose_conversion.h"
#include "core/types.h"

namespace adasfm {

// What keypoints of a camera have in common along the radius.
struct LensError {
  // Root mean square, over equal shares of the keypoints from the principal
  // point to the rim, of their median radial residual [px].
  double rms_px = 0.0;
  // That over 1 sigma of a keypoint; what chance gives is taken off.
  double ratio = 0.0;
};

// How far the lens models of an adjusted model bend images otherwise than the
// lenses did. Where cameras turn, poses and points cannot take up a wrong
// camera model or distortion as a whole (straight along the view they can, and
// it does not show): what is left moves keypoints towards the principal
// point or away from it, by an amount that depends on the distance. Right
// models leave a ratio below 0.05, calibrations of real cameras 0.02 to 0.2,
// pinhole and fisheye exchanged 0.15 to 0.7. A focal length that is wrong by
// itself does not show. The sigma is that of the residuals across the radius,
// which no lens changes.
//
// Input: points that three images or more see. Cameras with fewer than 800
// observations of such points are left out.
std::map<camera_t, LensError> MeasureLensErrors(
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
