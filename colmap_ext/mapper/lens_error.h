// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>

#include "colmap_ext/host/pose_conversion.h"
#include "core/types.h"

namespace adasfm {

// The radial error that the keypoints of a camera share.
struct LensError {
  // Root mean square, over equal shares of the keypoints from the principal
  // point to the rim, of their median radial residual [px].
  double rms_px = 0.0;
  // rms_px over 1 sigma of a keypoint, without the part expected by chance.
  double ratio = 0.0;
};

// Measures how far the lens models of an adjusted model deviate from the
// lenses. Where cameras turn, poses and points cannot compensate a wrong camera
// model or distortion completely (straight along the view they can, and the
// error does not show). The remaining error moves keypoints towards the
// principal point or away from it, by an amount that depends on the distance.
// Correct models have a ratio below 0.05, calibrations of real cameras 0.02 to
// 0.2, pinhole and fisheye exchanged 0.15 to 0.7. A wrong focal length alone
// does not show. The sigma is that of the residuals across the radius, which no
// lens changes.
//
// Input: points that three images or more see. Cameras with fewer than 800
// observations of such points are left out.
std::map<camera_t, LensError> MeasureLensErrors(
    const colmap::Reconstruction& reconstruction);

}  // namespace adasfm
