// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/so3.h"
#include "core/types.h"

namespace adasfm {

// How well a good calibration knows the cameras of a rig against each other, 1
// sigma, per axis.
inline constexpr double kRigRotationSigmaDeg = 0.05;
inline constexpr double kRigTranslationSigmaM = 2e-3;

// A camera of a rig: cameras that are mounted together and take their images at
// the same times. The reference camera's frame is the rig's.
struct RigCamera {
  uint32_t rig_id = 0;
  bool is_reference = false;
  // The identity for the reference camera; none when nobody knows it.
  std::optional<Rigid3d> cam_from_rig;
  // 1 sigma of its error, which all frames share, per axis.
  double rotation_sigma_rad = DegToRad(kRigRotationSigmaDeg);
  double translation_sigma_m = kRigTranslationSigmaM;
};

struct RigImage {
  camera_t camera_id = 0;
  // Images of one frame were taken at one time.
  uint32_t frame_id = 0;
};

// The rigs of several cameras; other cameras and their images are in neither
// map.
struct CameraRigs {
  std::map<camera_t, RigCamera> cameras;
  std::map<image_t, RigImage> images;

  bool empty() const { return images.empty(); }
};

// The image that stands for each frame: the reference camera's or, where that
// is missing, the one of the smallest camera id whose cam_from_rig is known.
// Frames of unknown cameras alone have none.
std::map<uint32_t, image_t> FindFrameLeaders(const CameraRigs& rigs);

// The relative poses within the frames as priors: from each frame's leader to
// each of its other images of a known camera, in order of the frames and
// images. Their errors are shared, which no covariance of a single prior says.
std::vector<RelativePosePrior> ComputeFramePriors(const CameraRigs& rigs);

// What: the cameras' relative poses from the frames of a model, for the cameras
// without cam_from_rig: the rotation nearest to all frames' rotations and the
// median of their translations, per axis, in the model's unit. Cameras that
// share fewer than 3 frames with their reference camera stay unknown. The
// sigmas become those of the mean over the frames.
void EstimateUnknownRigCameras(
    const std::map<image_t, Rigid3d>& cams_from_world, CameraRigs* rigs);

}  // namespace adasfm
