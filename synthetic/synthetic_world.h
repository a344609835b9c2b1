// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/bearing.h"
#include "core/rigid3d.h"
#include "core/sensor_log.h"
#include "core/types.h"
#include "synthetic/synthetic_world_options.h"

namespace adasfm {

struct SyntheticCamera {
  SyntheticCameraModel model = SyntheticCameraModel::kPinhole;
  int width = 800;
  int height = 500;
  double focal_px = 480.0;
  double principal_x_px = 400.0;
  double principal_y_px = 250.0;
  // kFisheye: the four coefficients of OpenCV's fisheye model.
  Eigen::Vector4d fisheye_coeffs = Eigen::Vector4d::Zero();
};

// Poses of the camera at the beginning and the end of a short time: while the
// rows of an image are read, or while its shutter is open.
struct ExposurePoses {
  Rigid3d first_cam_from_world;
  Rigid3d last_cam_from_world;

  // share: 0 at the beginning, 1 at the end; interpolated in between.
  Rigid3d CamFromWorldAt(double share) const;
};

struct SyntheticImage {
  image_t image_id = kInvalidImageId;  // 1, 2, ... in order of the list
  int camera_index = 0;
  // "<timestamp_ns>.png"; below cam0/ and cam1/ where there are two cameras.
  std::string name;
  timestamp_t timestamp_ns = 0;  // the camera's clock
  Rigid3d cam_from_world;        // true pose; world is z-up, in metres
  std::vector<Eigen::Vector2d> keypoints;
  // The landmark of each keypoint; keypoints on cars have unique numbers beyond
  // all landmarks.
  std::vector<int> landmark_ids;
  // The car point of each keypoint, -1 for none; empty without cars.
  std::vector<int> car_point_ids;
  std::vector<Rigid3d> cam_from_car;
  // Focal length of this image divided by that of the camera.
  double focal_factor = 1.0;
  // Factor on a photo's grey levels before they are clipped.
  double exposure_gain = 1.0;
  // Poses while the shutter is open; unset without an exposure time.
  std::optional<ExposurePoses> shutter;
};

struct SyntheticPair {
  image_t image_id1 = kInvalidImageId;  // < image_id2
  image_t image_id2 = kInvalidImageId;
  std::vector<FeatureMatch> raw_matches;
  std::vector<FeatureMatch> inlier_matches;
  // A two-view estimate with realistic errors; unit translation.
  Rigid3d cam2_from_cam1;
  // The pair joins two places that look alike; its matches are wrong.
  bool is_alias = false;
  // The pair joins places with nothing in common.
  bool is_spurious = false;
  // The matches are right, the pose is not.
  bool is_rotation_outlier = false;
};

// A position of a receiver, in the world.
struct SyntheticFix {
  timestamp_t timestamp_ns = 0;  // the IMU's clock
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
};

struct SyntheticWorld {
  SyntheticWorldOptions options;
  SyntheticCamera camera;
  Rigid3d cam_from_imu;  // of the first camera
  // Without a second camera the identity.
  Rigid3d cam1_from_cam0;
  Rigid3d imu_from_wheel;
  double track_width_m = 1.2;
  // In order of time; all of the first camera, then all of the second.
  std::vector<SyntheticImage> images;
  std::vector<Eigen::Vector3d> landmarks;
  // Sorted by (image_id1, image_id2).
  std::vector<SyntheticPair> pairs;
  std::vector<ImuSample> imu_samples;
  std::vector<WheelSample> wheel_samples;                    // kDifferential
  Eigen::Vector3d true_gyro_bias = Eigen::Vector3d::Zero();  // at the start
  Eigen::Vector3d true_accel_bias = Eigen::Vector3d::Zero();
  // Camera-clock intervals of the slips.
  std::vector<std::pair<timestamp_t, timestamp_t>> wheel_slips;
  std::vector<SyntheticFix> gnss_fixes;
  Eigen::Vector3d antenna_in_imu = Eigen::Vector3d(0.1, 0.0, 1.2);
  // Camera-clock intervals at rest after the start, with turns on the spot.
  std::vector<std::pair<timestamp_t, timestamp_t>> stops;
  // Pairs of streets that were made to look alike.
  int num_twins = 0;
};

// Throws std::invalid_argument for options that are not valid, or ask for more
// than the drive can have; the message names the largest possible value.
SyntheticWorld BuildSyntheticWorld(const SyntheticWorldOptions& options);

// The camera with the focal length of the image, which is hidden from all
// estimators.
SyntheticCamera CameraOfImage(const SyntheticCamera& camera,
                              const SyntheticImage& image);

// The ray of a pixel and its derivative. Throws for a pixel that the fisheye
// model cannot reach.
Bearing ComputeBearing(const SyntheticCamera& camera,
                       const Eigen::Vector2d& pixel);

// False when the point lies behind the camera (beyond its field of view).
bool ProjectPoint(const SyntheticCamera& camera,
                  const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel);

// All keypoints of an image as rays.
std::vector<Bearing> ComputeBearings(const SyntheticCamera& camera,
                                     const SyntheticImage& image);

}  // namespace adasfm
