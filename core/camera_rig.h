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

// Error of the relative poses of the cameras of a rig after a good calibration,
// 1 sigma per axis.
inline constexpr double kRigRotationSigmaDeg = 0.05;
inline constexpr double kRigTranslationSigmaM = 2e-3;

// A camera of a rig. Cameras of a rig are mounted together and take their
// images at the same times. The frame of the reference camera is that of the
// rig.
struct RigCamera {
  uint32_t rig_id = 0;
  bool is_reference = false;
  // The identity for the reference camera; none when it is unknown.
  std::optional<Rigid3d> cam_from_rig;
  // 1 sigma per axis of the error of cam_from_rig, which all frames share.
  double rotation_sigma_rad = DegToRad(kRigRotationSigmaDeg);
  double translation_sigma_m = kRigTranslationSigmaM;
};

struct RigImage {
  camera_t camera_id = 0;
  // Images of one frame were taken at one time.
  uint32_t frame_id = 0;
};

// The rigs with several cameras; other cameras and their images are in neither
// map.
struct CameraRigs {
  std::map<camera_t, RigCamera> cameras;
  std::map<image_t, RigImage> images;

  bool empty() const { return images.empty(); }
};

// The leader of each frame: the reference camera's image or, where that is
// missing, the image of the smallest camera id among cameras with cam_from_rig.
// Frames without such a camera have no leader.
std::map<uint32_t, image_t> FindFrameLeaders(const CameraRigs& rigs);

// The relative poses within the frames as priors: from the leader of each frame
// to each other image of a camera with cam_from_rig, in order of frames and
// images. All frames share the errors, which the covariance of a single prior
// cannot express.
std::vector<RelativePosePrior> ComputeFramePriors(const CameraRigs& rigs);

// Estimates cam_from_rig, for the cameras without it, from the frames of a
// model: the rotation nearest to the rotations of all frames and the per-axis
// median of the translations, in the unit of the model. Cameras that share
// fewer than 3 frames with their reference camera stay unknown. The sigmas
// become those of the mean over the frames.
void EstimateUnknownRigCameras(
    const std::map<image_t, Rigid3d>& cams_from_world, CameraRigs* rigs);

}  // namespace adasfm
