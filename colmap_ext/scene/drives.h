// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// By drive (RelativePosePrior::drive): rotation to the true camera frame from
// the one that T_cam_imu states; none where T_cam_imu is right.
using CameraImuCorrectionMap = std::map<int, Eigen::Quaterniond>;

// By drive: what timeshift_cam_imu lacks, s.
using TimeShiftMap = std::map<int, double>;

// By drive: scale errors of the gyroscope (CorrectGyroscopeScales in
// core/relative_pose_prior.h).
using GyroscopeScaleMap = std::map<int, Eigen::Vector3d>;

// Sets the drives of the scene's images, priors and inertial motions. Images
// that priors connect are of one drive, and so are those of one camera or rig:
// gaps in a log do not change the machine. Numbers follow the order of the
// priors; images of other cameras have no drive.
void NumberDrives(SceneData* scene);

// What reports call a drive that has priors: its first image.
std::string DriveName(const SceneData& scene, int drive);

void RotatePriors(const CameraImuCorrectionMap& corrections,
                  std::vector<RelativePosePrior>* priors);
// Rotates the rest of what the IMU measured: gravity and inertial motions.
void RotateGravityAndMotions(const CameraImuCorrectionMap& corrections,
                             SceneData* scene);
CameraImuCorrectionMap Inverted(CameraImuCorrectionMap corrections);
// Corrects priors and inertial motions.
void AddTimeShifts(const TimeShiftMap& shifts,
                   std::vector<RelativePosePrior>* priors,
                   std::vector<InertialMotion>* motions);
// The priors must be in the frames of the corrected T_cam_imu.
void CorrectGyroscopeScales(const GyroscopeScaleMap& scales,
                            std::vector<RelativePosePrior>* priors);

// Corrections by camera, as the database has them, and back.
template <typename Correction>
std::map<camera_t, Correction> CorrectionsByCamera(
    const SceneData& scene, const std::map<int, Correction>& corrections) {
  std::map<camera_t, Correction> by_camera;
  for (const auto& [image_id, image] : scene.images) {
    const auto found = corrections.find(image.drive);
    if (found == corrections.end()) continue;
    by_camera.emplace(image.camera_id, found->second);
  }
  return by_camera;
}

template <typename Correction>
std::map<int, Correction> CorrectionsByDrive(
    const SceneData& scene, const std::map<camera_t, Correction>& corrections) {
  std::map<int, Correction> by_drive;
  for (const auto& [image_id, image] : scene.images) {
    const auto found = corrections.find(image.camera_id);
    if (found != corrections.end() && image.drive >= 0) {
      by_drive.emplace(image.drive, found->second);
    }
  }
  return by_drive;
}

}  // namespace adasfm
