// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

struct FocalLengthCalibrationOptions {
  bool enabled = true;
  // An even subset of a camera's pairs and of their matches: more tells little.
  int max_num_pairs = 200;
  int max_num_matches = 80;
  // Where the Cauchy loss takes over, px of epipolar distance.
  double loss_scale_px = 1.5;
  // 1 sigma of a keypoint, px.
  double keypoint_sigma_px = 0.5;
  // A focal length that the pairs leave less certain (1 sigma of its logarithm)
  // is not taken: drives straight on hardly tell it.
  double max_relative_sigma = 0.05;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct CalibratedFocalLength {
  camera_t camera_id = 0;
  double given_px = 0.0;
  double found_px = 0.0;
  // 1 sigma over found_px by the scatter of the pairs. Of what they have in
  // common, such as exposure row by row, DescribeFocalLength adds 3.5 %.
  double relative_sigma = 0.0;
  int num_pairs = 0;
};

// Focal lengths that the database does not mark as known are COLMAP's guess,
// 1.2 times the longer side: phones have 0.7 to 0.8 of it. Two-view rotations
// are then wrong by as much, and those of a gyroscope contradict them.
//
// The focal length at which the epipolar distances of the camera's pairs are
// least, each pair with the essential matrix that suits it best (view graph
// calibration, as in Sweeney et al., ICCV 2015, with distances in the image);
// pairs straight on cost the same everywhere, and none counts beyond a bound.
// What is given does not matter for what is found: from 0.38 to 2.6 of the
// longer side all are tried. A distortion that is not given is estimated, too:
// taken for zero, a slight barrel (-0.05) made it 6 % too long. It has two
// radial terms: with one, a phone's came out 16 % too short. The sigma is the
// pairs' sandwich.
//
// Both images of a pair must have the camera. Cameras whose focal length was
// found, with certainty, and whose lens is other than given are changed in
// `scene` and returned; the principal point stays, and so does a distortion
// that is given. SIMPLE_RADIAL and SIMPLE_RADIAL_FISHEYE become RADIAL and
// RADIAL_FISHEYE then. The caller goes on from there: an adjustment of many
// images tells a lens better (CoarseModelInput::refine_lenses).
std::vector<CalibratedFocalLength> CalibrateFocalLengths(
    const FocalLengthCalibrationOptions& options, SceneData* scene);

// For the user.
std::string DescribeFocalLength(const CalibratedFocalLength& calibrated);

}  // namespace adasfm
