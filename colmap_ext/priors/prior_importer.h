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

// Empty paths: the machine has no such log.
struct PriorImportPaths {
  std::string database_path;
  std::string image_times_path;
  std::string imu_path;
  std::string wheel_path;
  // Positions (sensors/io/read_gnss.h), or "database" for those that COLMAP has
  // stored in the database.
  std::string gnss_path;
  std::string sensors_path;
  // A bag with the logs that have no path of their own.
  std::string bag_path;
  BagTopicNames bag_topics;
  // A metric trajectory in place of logs: TUM (world_from_body; the body is the
  // IMU of the calibration or, without one, the camera) or a COLMAP model.
  std::string trajectory_path;
};

struct PriorImportOptions {
  FocalLengthCalibrationOptions focal_lengths;
  PriorEstimationOptions estimation;
  TrajectoryPriorOptions trajectory;
  PositionPriorOptions positions;
  RigOptions rig;
  // Two-view rotations are taken from images at most this many apart in time:
  // rotations grow with the gap, but so does the chance of a wrong pair.
  int max_visual_gap = 3;
  // In GB (1e9 bytes); -1: no bound. ImportPriors does not begin what is
  // estimated to take more.
  double max_memory_gb = -1.0;

  bool IsValid(std::string* error) const;
};

struct PriorImport {
  PriorTables tables;
  SensorSummary summary;
  int num_images_without_time = 0;
  int num_visual_rotations = 0;
  // Of the import and of the sensors.
  std::vector<std::string> warnings;
  // Samples that were left out of the logs.
  std::vector<LogFault> log_faults;
  // Of the positions.
  int num_fixes = 0;
  int num_fixes_outside = 0;
  std::map<std::string, int> num_fixes_left_out;  // by reason
  double seconds = 0.0;                           // that it took
};

// (1) Reads the scene, the calibration and the logs, (2) gives the images their
// times by name, (3) takes the two-view rotations of near images, (4) estimates
// the priors. The database is not changed: WritePriorTables does that.
StatusOr<PriorImport> ComputePriorImport(const PriorImportPaths& paths,
                                         const PriorImportOptions& options);

std::string FormatPriorImport(const PriorImport& import);
std::string PriorImportToJson(const PriorImport& import);

}  // namespace adasfm
