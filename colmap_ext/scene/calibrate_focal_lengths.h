// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

struct FocalLengthCalibrationOptions {
  bool enabled = true;
  int num_threads = -1;
};

struct CalibratedFocalLength {
  camera_t camera_id = 0;
  double given_px = 0.0;
  double found_px = 0.0;
  // 1 sigma over found_px from the scatter of the pairs. DescribeFocalLength
  // adds 3.5 % for errors that all pairs share, such as those of a rolling
  // shutter.
  double relative_sigma = 0.0;
  int num_pairs = 0;
};

// Focal lengths that the database does not mark as known are COLMAP's guess,
// 1.2 times the longer side, where phones have 0.7 to 0.8 times. Two-view
// rotations then have errors of the same size and contradict the gyroscope.
//
// Finds the focal length that minimises the epipolar distances of the camera's
// pairs, each with its best essential matrix (view graph calibration, as in
// Sweeney et al., ICCV 2015, with distances in the image). Pairs of straight
// motion have the same cost everywhere, and the cost of each pair is bounded.
// The result does not depend on the given focal length: all from 0.38 to 2.6
// times the longer side are tried. A distortion that is not given is estimated,
// too: assuming zero in place of a slight barrel (-0.05) made the focal length
// 6 % too long. Two radial terms are estimated: with one, a phone's focal
// length came out 16 % too short. The sigma is the sandwich estimate over
// pairs.
//
// Both images of a pair must have the camera. Cameras with a certain result
// that differs from the given lens are changed in `scene` and returned. The
// principal point stays, and so does a given distortion. SIMPLE_RADIAL and
// SIMPLE_RADIAL_FISHEYE become RADIAL and RADIAL_FISHEYE. The result is a
// start: an adjustment of many images estimates a lens better
// (CoarseModelInput::refine_lenses).
std::vector<CalibratedFocalLength> CalibrateFocalLengths(
    const FocalLengthCalibrationOptions& options, SceneData* scene);

// A message for the user.
std::string DescribeFocalLength(const CalibratedFocalLength& calibrated);

}  // namespace adasfm
