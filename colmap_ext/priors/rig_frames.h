// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/camera_rig.h"
#include "core/status.h"
#include "sensors/estimate_priors.h"

namespace adasfm {

// 1 sigma, per axis, of the calibration's poses of the cameras of a rig
// relative to each other.
struct RigOptions {
  double rotation_sigma_deg = kRigRotationSigmaDeg;
  double translation_sigma_m = kRigTranslationSigmaM;

  bool IsValid(std::string* error) const;
};

// Returns the cameras of the calibration's rig by the database's ids, relative
// to the host's reference camera or, without a rig of the host, to cam0. Empty
// when the calibration or the database has one camera only, or when their
// cameras cannot be assigned (with a warning). Images in folders cam0, cam1,
// ... determine their cameras; otherwise the calibration's cameras are those of
// the database in the order of their ids. calibration->cam_from_imu becomes
// that of the reference camera.
// An error when images of two cameras of the calibration share a camera of the
// database, or the other way round.
StatusOr<std::map<camera_t, RigCamera>> FindRigCameras(
    const RigOptions& options, const SceneData& scene,
    SensorCalibration* calibration, std::vector<std::string>* warnings);

// Groups images of different cameras at most a millisecond apart into frames,
// and gives them the time of the frame's reference camera or, without one, of
// its first image. Inputs: stamps in order of time; stamps of cameras outside
// the rig are not changed. Returns the stamps between which motion is
// estimated: those of the reference camera or, without a rig, all.
std::vector<ImageStamp> GroupFrames(
    const SceneData& scene, const std::map<camera_t, RigCamera>& cameras,
    std::vector<ImageStamp>* stamps);

}  // namespace adasfm
