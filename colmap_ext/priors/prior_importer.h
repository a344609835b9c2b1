// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/priors/rig_frames.h"
#include "colmap_ext/scene/calibrate_focal_lengths.h"
#include "core/status.h"
#include "sensors/estimate_priors.h"
#include "sensors/io/bag_topics.h"
#include "sensors/log_cleaning/log_fault.h"
#include "sensors/position_priors.h"
#include "sensors/trajectory_priors.h"

namespace adasfm {

// Empty paths: there is no such log.
struct PriorImportPaths {
  std::string database_path;
  std::string image_times_path;
  std::string imu_path;
  std::string wheel_path;
  // Positions (sensors/io/read_gnss.h), or "database" for those that COLMAP has
  // stored in the database.
  std::string gnss_path;
  std::string sensors_path;
  // A bag that provides the logs that have no path.
  std::string bag_path;
  BagTopicNames bag_topics;
  // A metric trajectory in place of logs: TUM (world_from_body; the body is the
  // calibration's IMU or, without one, the camera) or a COLMAP model.
  std::string trajectory_path;
};

struct PriorImportOptions {
  FocalLengthCalibrationOptions focal_lengths;
  PriorEstimationOptions estimation;
  TrajectoryPriorOptions trajectory;
  PositionPriorOptions positions;
  RigOptions rig;
  // In GB (1e9 bytes); -1: no bound. ImportPriors returns an error before work
  // whose estimated memory exceeds the bound.
  double max_memory_gb = -1.0;

  bool IsValid(std::string* error) const;
};

struct PriorImport {
  PriorTables tables;
  SensorSummary summary;
  int num_images_without_time = 0;
  int num_visual_rotations = 0;
  // Warnings of the import and of the sensors.
  std::vector<std::string> warnings;
  // Samples that were removed from the logs.
  std::vector<LogFault> log_faults;
  // Counts of positions.
  int num_fixes = 0;
  int num_fixes_outside = 0;
  std::map<std::string, int> num_fixes_left_out;  // by reason
  double seconds = 0.0;                           // duration of the import
};

// (1) Reads the scene, the calibration and the logs, (2) assigns times to
// images by name, (3) computes two-view rotations of images near in time, (4)
// estimates the priors. The database is not changed: WritePriorTables does
// that.
StatusOr<PriorImport> ComputePriorImport(const PriorImportPaths& paths,
                                         const PriorImportOptions& options);

std::string FormatPriorImport(const PriorImport& import);
std::string PriorImportToJson(const PriorImport& import);

}  // namespace adasfm
