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

// How well the calibration knows the cameras of a rig against each other, 1
// sigma, per axis.
struct RigOptions {
  double rotation_sigma_deg = kRigRotationSigmaDeg;
  double translation_sigma_m = kRigTranslationSigmaM;

  bool IsValid(std::string* error) const;
};

// What: the cameras of the calibration's rig by the database's ids, relative to
// the host's reference camera or, without a rig of the host, to cam0; empty for
// a calibration of one camera and where the database has one. Images below a
// folder cam0, cam1, ... tell their cameras; otherwise the cameras of the
// calibration are those of the database in the order of their ids.
// calibration->cam_from_imu becomes that of the reference camera.
// On failure: an error when images of two cameras of the calibration share a
// camera of the database, or the other way round.
StatusOr<std::map<camera_t, RigCamera>> FindRigCameras(
    const RigOptions& options, const SceneData& scene,
    SensorCalibration* calibration, std::vector<std::string>* warnings);

// What: images of different cameras at most a millisecond apart are one frame,
// and get the time of its reference camera or, without one, of its first image.
// Inputs: stamps in order of time; those of other cameras are left alone.
// Returns the stamps that the motion between frames belongs to: the reference
// camera's and, without a rig, all of them.
std::vector<ImageStamp> GroupFrames(
    const SceneData& scene, const std::map<camera_t, RigCamera>& cameras,
    std::vector<ImageStamp>* stamps);

}  // namespace adasfm
