// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/pose_prior_table.h"

#include <algorithm>
#include <limits>
#include <string>

#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

// COLMAP's coordinate systems of a prior, and its sensor type of a camera.
constexpr int64_t kWgs84 = 0;
constexpr int64_t kCartesian = 1;
constexpr int64_t kCameraSensor = 0;

// COLMAP writes NaN for an unknown covariance.
std::optional<Eigen::Matrix3d> ReadCovariance(const SqliteStatement& statement,
                                              int column,
                                              const std::string& row) {
  if (statement.IsNull(column) || statement.NumBytes(column) == 0) {
    return std::nullopt;
  }
  Eigen::Matrix3d covariance;
  DoublesFromBlob(statement, column, row, 9, covariance.data());
  if (!covariance.allFinite()) return std::nullopt;
  return covariance;
}

std::vector<HostPosition> ReadPosePriors(SqliteConnection* database) {
  const bool has_sensors = HasColumn(database, "pose_priors", "corr_data_id");
  const bool has_covariance =
      HasColumn(database, "pose_priors", "position_covariance");
  const std::string image_id = has_sensors ? "corr_data_id" : "image_id";
  SqliteStatement statement(
      database, "SELECT " + image_id + ", coordinate_system, position, " +
                    (has_covariance ? "position_covariance" : "NULL") +
                    " FROM pose_priors WHERE position IS NOT NULL" +
                    (has_sensors ? " AND corr_sensor_type = " +
                                       std::to_string(kCameraSensor)
                                 : "") +
                    " ORDER BY " + image_id);
  std::vector<HostPosition> positions;
  while (statement.Step()) {
    const std::string row =
        "table pose_priors, image " + std::to_string(statement.Int(0));
    const int64_t system = statement.Int(1);
    if ((system != kWgs84 && system != kCartesian) ||
        statement.NumBytes(2) == 0) {
      continue;
    }
    HostPosition position;
    position.image_id = static_cast<image_t>(statement.Int(0));
    position.is_geodetic = system == kWgs84;
    DoublesFromBlob(statement, 2, row, 3, position.position.data());
    position.covariance = ReadCovariance(statement, 3, row);
    if (position.position.allFinite()) positions.push_back(position);
  }
  return positions;
}

std::vector<HostPosition> ReadImagePriors(SqliteConnection* database) {
  std::vector<HostPosition> positions;
  SqliteStatement statement(
      database,
      "SELECT image_id, prior_tx, prior_ty, prior_tz FROM images WHERE "
      "prior_tx IS NOT NULL AND prior_ty IS NOT NULL AND prior_tz IS NOT NULL "
      "ORDER BY image_id");
  while (statement.Step()) {
    HostPosition position;
    position.image_id = static_cast<image_t>(statement.Int(0));
    position.is_geodetic = true;
    position.position << statement.Double(1), statement.Double(2),
        statement.Double(3);
    if (position.position.allFinite()) positions.push_back(position);
  }
  return positions;
}

}  // namespace

std::vector<HostPosition> ReadHostPositions(SqliteConnection* database) {
  if (database->HasTable("pose_priors")) return ReadPosePriors(database);
  if (HasColumn(database, "images", "prior_tx")) {
    return ReadImagePriors(database);
  }
  return {};
}

bool HasPosePriorTable(SqliteConnection* database) {
  return HasColumn(database, "pose_priors", "corr_data_id") &&
         HasColumn(database, "pose_priors", "gravity");
}

void WritePosePriors(const std::vector<NewPosePrior>& priors,
                     SqliteConnection* database) {
  SqliteStatement remove(database,
                         "DELETE FROM pose_priors WHERE corr_data_id = ? AND "
                         "corr_sensor_type = " +
                             std::to_string(kCameraSensor));
  SqliteStatement insert(
      database,
      "INSERT INTO pose_priors (corr_data_id, corr_sensor_id, "
      "corr_sensor_type, position, position_covariance, gravity, "
      "coordinate_system) VALUES (?, ?, ?, ?, ?, ?, ?)");
  for (const NewPosePrior& prior : priors) {
    remove.Reset();
    remove.BindInt(1, prior.image_id);
    remove.Step();
    insert.Reset();
    insert.BindInt(1, prior.image_id);
    insert.BindInt(2, prior.camera_id);
    insert.BindInt(3, kCameraSensor);
    BindDoubles(&insert, 4, prior.position.data(), 3);
    BindDoubles(&insert, 5, prior.covariance.data(), 9);
    // COLMAP writes NaN for an unknown gravity.
    const Eigen::Vector3d gravity = prior.gravity_in_cam.value_or(
        Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    BindDoubles(&insert, 6, gravity.data(), 3);
    insert.BindInt(7, kCartesian);
    insert.Step();
  }
}

}  // namespace adasfm
