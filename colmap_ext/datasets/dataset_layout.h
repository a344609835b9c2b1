// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Paths in a recording that the reconstruction needs. Empty members: the
// recording does not have them.
struct DatasetLayout {
  std::string image_path;  // folder of the photos
  // COLMAP's name and parameters (comma-separated); pixel centres at 0.5.
  std::string camera_model;
  std::string camera_params;
  std::string imu_path;
  // Existing files, or the text of files to write.
  std::string image_times_path;
  std::string image_times_text;
  std::string sensors_text;  // docs/reference/sensors.md
  // Period of the IMU, so that a log of 10 Hz is not taken for a log with gaps.
  double imu_period_s = 0.0;
};

// Finds the files of a recording of a known format at its root folder
// (docs/guide/automatic_reconstruction.md lists them):
//   euroc     a folder with mav0/, or mav0/ itself
//   4seasons  a recording; its calibration/ inside or beside it
//   kitti     a raw drive (the calibration in the folder above), or a sequence
//             of the odometry benchmark
//   tum       an RGB-D sequence; no calibration, no IMU
// The first camera is used (KITTI: the left colour camera, if available).
// Errors name the file that is missing or malformed.
StatusOr<DatasetLayout> FindDatasetLayout(const std::string& format,
                                          const std::string& root);

// The layouts one by one, for FindDatasetLayout.
StatusOr<DatasetLayout> FindEurocLayout(const std::string& root);
StatusOr<DatasetLayout> Find4SeasonsLayout(const std::string& root);
StatusOr<DatasetLayout> FindKittiRawLayout(const std::string& root);
StatusOr<DatasetLayout> FindKittiOdometryLayout(const std::string& root);
StatusOr<DatasetLayout> FindTumLayout(const std::string& root);

}  // namespace adasfm
