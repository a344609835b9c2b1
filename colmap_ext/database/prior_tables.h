// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_rig.h"
#include "core/inertial_motion.h"
#include "core/position_prior.h"
#include "core/prior_lengths.h"
#include "core/relative_pose_prior.h"
#include "core/sqlite.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// The tables adasfm_image_times, adasfm_relative_pose_priors, adasfm_gravity,
// adasfm_position_priors, adasfm_gyroscope_bias, adasfm_length_drift,
// adasfm_inertial_motions and adasfm_rig_cameras inside a COLMAP database
// (docs/reference/formats.md). Databases of before the last five are read as
// having no positions, no stated bias or drift, no such motions and no rig.

struct ImageTimeRow {
  image_t image_id = kInvalidImageId;
  timestamp_t timestamp_ns = 0;
};

struct GravityRow {
  image_t image_id = kInvalidImageId;
  // Unit vector towards the ground, in the camera frame.
  Eigen::Vector3d gravity_in_cam = Eigen::Vector3d::UnitY();
};

struct PriorTables {
  std::vector<ImageTimeRow> image_times;
  // Consecutive images, sorted by time.
  std::vector<RelativePosePrior> priors;
  std::vector<GravityRow> gravity;
  std::vector<PositionPrior> positions;
  // Of the positions' ENU frame; none for positions in a frame of their own.
  std::optional<GeodeticPosition> position_origin;
  // Of what the import left of the gyroscope's bias, in the camera frame,
  // rad^2/s^2, and without an IMU of the rate that wheels err by alike; none
  // where neither tells a turn, and in databases of before it.
  std::optional<Eigen::Matrix3d> gyroscope_bias_covariance;
  // 1 sigma of the error that the lengths of neighbouring priors share, as a
  // ratio; 0 where nothing shows one, and in databases of before it.
  double length_drift_ratio = 0.0;
  // None without wheels, in databases of before it, and of merged imports.
  std::optional<WheelScale> wheel_scale;
  // Of imports with an IMU: consecutive images, in order of time.
  std::vector<InertialMotion> inertial_motions;
  // Of one rig of several cameras; all known. Written here, and read by
  // ReadCameraRigs.
  std::map<camera_t, RigCamera> rig_cameras;
};

// Replaces all rows, in one transaction. An error, and no change, when the
// database is not COLMAP's, cannot be written, or lacks an image of the rows.
Status WritePriorTables(const std::string& database_path,
                        const PriorTables& tables);

struct LoadedPriorTables {
  PriorTables tables;
  // Rows of images that the database does not have any more.
  int num_ignored_rows = 0;
};

// Without the tables the result is empty. Rows are matched by image name: where
// the ids have changed since the import the present ones are returned. An error
// for rows that could not have been written by WritePriorTables.
StatusOr<LoadedPriorTables> ReadPriorTables(const std::string& database_path);

// As above on an open connection; throws SqliteError.
LoadedPriorTables ReadPriorTables(SqliteConnection* database);

// Creates adasfm_meta when needed, and throws SqliteError when its schema
// version is not ours.
void CreateMetaTable(SqliteConnection* database);
void CheckMetaTable(SqliteConnection* database);

}  // namespace adasfm
