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
// adasfm_wheel_scale, adasfm_time_shift_effects, adasfm_inertial_motions and
// adasfm_rig_cameras in a COLMAP database (docs/reference/formats.md). Older
// databases may lack the last seven; their values are then absent.

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
  // Origin of the positions' ENU frame; none for positions in a frame of their
  // own.
  std::optional<GeodeticPosition> position_origin;
  // Covariance of the gyroscope bias that remains after the import, in the
  // camera frame [rad^2/s^2]; without an IMU, of the common error of the
  // wheels' turn rate. None where neither sensor measures rotation, and in
  // databases without the table.
  std::optional<Eigen::Matrix3d> gyroscope_bias_covariance;
  // 1 sigma of the error that the lengths of neighbouring priors share, as a
  // ratio; 0 where no such error was observed, and in databases without the
  // table.
  double length_drift_ratio = 0.0;
  // None without wheels, for merged imports, and in databases without the
  // table.
  std::optional<WheelScale> wheel_scale;
  // Of imports with an IMU: between consecutive images, in order of time.
  std::vector<InertialMotion> inertial_motions;
  // Of one rig of several cameras, all with known cam_from_rig. Written by
  // WritePriorTables, but read by ReadCameraRigs.
  std::map<camera_t, RigCamera> rig_cameras;
};

// Replaces all rows, in one transaction. An error, and no change, when the
// database is not COLMAP's, cannot be written, or lacks an image of the rows.
Status WritePriorTables(const std::string& database_path,
                        const PriorTables& tables);

// Removes what WritePriorTables and adasfm_global wrote. Throws SqliteError.
void RemovePriorTables(SqliteConnection* database);

struct LoadedPriorTables {
  PriorTables tables;
  // Rows of images that the database no longer has.
  int num_ignored_rows = 0;
};

// Without the tables the result is empty. Rows are matched by image name: where
// ids have changed since the import, the present ids are returned. An error for
// rows that WritePriorTables could not have written.
StatusOr<LoadedPriorTables> ReadPriorTables(const std::string& database_path);

// As above on an open connection; throws SqliteError.
LoadedPriorTables ReadPriorTables(SqliteConnection* database);

// CreateMetaTable creates adasfm_meta when needed. Both throw SqliteError when
// the schema version is not ours.
void CreateMetaTable(SqliteConnection* database);
void CheckMetaTable(SqliteConnection* database);

}  // namespace adasfm
