// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <vector>

#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// By drive (RelativePosePrior::drive): rotation to the true camera frame from
// the one that T_cam_imu states; none where T_cam_imu is right.
using CameraImuCorrectionMap = std::map<int, Eigen::Quaterniond>;

// Sets the drives of the scene's images, priors and inertial motions. Images
// that priors connect are of one drive, and so are those of one camera or rig:
// gaps in a log do not change the machine. Numbers follow the order of the
// priors; images of other cameras have no drive.
void NumberDrives(SceneData* scene);

void RotatePriors(const CameraImuCorrectionMap& corrections,
                  std::vector<RelativePosePrior>* priors);
// Rotates the rest of what the IMU measured: gravity and inertial motions.
void RotateGravityAndMotions(const CameraImuCorrectionMap& corrections,
                             SceneData* scene);
CameraImuCorrectionMap Inverted(CameraImuCorrectionMap corrections);

// The same by camera, as the database has them, and back.
std::map<camera_t, Eigen::Quaterniond> CorrectionsByCamera(
    const SceneData& scene, const CameraImuCorrectionMap& corrections);
CameraImuCorrectionMap CorrectionsByDrive(
    const SceneData& scene,
    const std::map<camera_t, Eigen::Quaterniond>& corrections);

}  // namespace adasfm
