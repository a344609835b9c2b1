// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_tables.h"

#include <cstdio>
#include <map>
#include <utility>

#include "colmap_ext/database/image_names.h"
#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/database/rig_table.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

constexpr int kSchemaVersion = 1;
// Those of CreateTables.
constexpr const char* kTables[] = {
    "adasfm_image_times",    "adasfm_relative_pose_priors",
    "adasfm_gravity",        "adasfm_position_priors",
    "adasfm_gyroscope_bias", "adasfm_length_drift",
    "adasfm_wheel_scale",    "adasfm_time_shift_effects"};

void CreateTables(SqliteConnection* database) {
  CreateMetaTable(database);
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_image_times ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "timestamp_ns INTEGER NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_relative_pose_priors ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, dt_ns INTEGER NOT NULL, "
      "qvec BLOB NOT NULL, tvec BLOB NOT NULL, covariance BLOB NOT NULL, "
      "flags INTEGER NOT NULL, PRIMARY KEY (image_id1, image_id2));"
      "CREATE TABLE IF NOT EXISTS adasfm_gravity ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "gravity_in_cam BLOB NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_position_priors ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, share REAL NOT NULL, "
      "position BLOB NOT NULL, covariance BLOB NOT NULL, "
      "antenna_in_cam BLOB NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_gyroscope_bias ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "covariance BLOB NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_length_drift ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "sigma_ratio REAL NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_wheel_scale ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "scale REAL NOT NULL, sigma REAL NOT NULL, stated_sigma REAL NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_time_shift_effects ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, "
      "rotation BLOB NOT NULL, translation BLOB NOT NULL, "
      "delta_velocity BLOB NOT NULL, delta_position BLOB NOT NULL, "
      "PRIMARY KEY (image_id1, image_id2));");
}

void WriteImageTimes(const ImageNames& names,
                     const std::vector<ImageTimeRow>& rows,
                     SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_image_times VALUES (?, ?, ?)");
  for (const ImageTimeRow& row : rows) {
    statement.Reset();
    statement.BindInt(1, row.image_id);
    statement.BindText(2, names.Name(row.image_id));
    statement.BindInt(3, row.timestamp_ns);
    statement.Step();
  }
}

void WritePriors(const ImageNames& names,
                 const std::vector<RelativePosePrior>& rows,
                 SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_relative_pose_priors VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const RelativePosePrior& row : rows) {
    const Eigen::Quaterniond& q = row.cam2_from_cam1.rotation;
    const Eigen::Vector4d qvec(q.w(), q.x(), q.y(), q.z());
    statement.Reset();
    names.BindPair(row.image_id1, row.image_id2, &statement);
    statement.BindInt(5, row.dt_ns);
    BindDoubles(&statement, 6, qvec.data(), 4);
    BindDoubles(&statement, 7, row.cam2_from_cam1.translation.data(), 3);
    // Symmetric, so row and column order are the same.
    BindDoubles(&statement, 8, row.covariance.data(), 36);
    statement.BindInt(9, row.flags);
    statement.Step();
  }
}

// Of the motions that an IMU measured.
void WriteTimeShiftEffects(const ImageNames& names, const PriorTables& tables,
                           SqliteConnection* database) {
  std::map<std::pair<image_t, image_t>, const InertialMotion*> motions;
  for (const InertialMotion& motion : tables.inertial_motions) {
    motions[{motion.image_id1, motion.image_id2}] = &motion;
  }
  SqliteStatement statement(
      database,
      "INSERT INTO adasfm_time_shift_effects VALUES (?, ?, ?, ?, ?, ?, ?, ?)");
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  for (const RelativePosePrior& prior : tables.priors) {
    if (prior.rotation_by_time_shift.isZero(0.0)) continue;
    const auto found = motions.find({prior.image_id1, prior.image_id2});
    const InertialMotion* motion =
        found == motions.end() ? nullptr : found->second;
    const auto bind = [&statement](int column, const Eigen::Vector3d& vector) {
      BindDoubles(&statement, column, vector.data(), 3);
    };
    statement.Reset();
    names.BindPair(prior.image_id1, prior.image_id2, &statement);
    bind(5, prior.rotation_by_time_shift);
    bind(6, prior.translation_by_time_shift);
    bind(7, motion == nullptr ? zero : motion->velocity_by_time_shift);
    bind(8, motion == nullptr ? zero : motion->position_by_time_shift);
    statement.Step();
  }
}

void WriteGravity(const ImageNames& names, const std::vector<GravityRow>& rows,
                  SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_gravity VALUES (?, ?, ?)");
  for (const GravityRow& row : rows) {
    statement.Reset();
    statement.BindInt(1, row.image_id);
    statement.BindText(2, names.Name(row.image_id));
    BindDoubles(&statement, 3, row.gravity_in_cam.data(), 3);
    statement.Step();
  }
}

void WritePositions(const ImageNames& names,
                    const std::vector<PositionPrior>& rows,
                    SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_position_priors VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?)");
  for (const PositionPrior& row : rows) {
    statement.Reset();
    names.BindPair(row.image_id1, row.image_id2, &statement);
    statement.BindDouble(5, row.share);
    BindDoubles(&statement, 6, row.position.data(), 3);
    BindDoubles(&statement, 7, row.covariance.data(), 9);
    BindDoubles(&statement, 8, row.antenna_in_cam.data(), 3);
    statement.Step();
  }
}

// Stored under the first image of the first prior, which identifies the import.
void WriteGyroscopeBias(const ImageNames& names, const PriorTables& tables,
                        SqliteConnection* database) {
  if (!tables.gyroscope_bias_covariance || tables.priors.empty()) return;
  const image_t image_id = tables.priors.front().image_id1;
  SqliteStatement statement(
      database, "INSERT INTO adasfm_gyroscope_bias VALUES (?, ?, ?)");
  statement.BindInt(1, image_id);
  statement.BindText(2, names.Name(image_id));
  BindDoubles(&statement, 3, tables.gyroscope_bias_covariance->data(), 9);
  statement.Step();
}

void WriteLengthDrift(const ImageNames& names, const PriorTables& tables,
                      SqliteConnection* database) {
  if (!(tables.length_drift_ratio > 0.0) || tables.priors.empty()) return;
  const image_t image_id = tables.priors.front().image_id1;
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_length_drift VALUES (?, ?, ?)");
  statement.BindInt(1, image_id);
  statement.BindText(2, names.Name(image_id));
  statement.BindDouble(3, tables.length_drift_ratio);
  statement.Step();
}

void WriteWheelScale(const ImageNames& names, const PriorTables& tables,
                     SqliteConnection* database) {
  if (!tables.wheel_scale || tables.priors.empty()) return;
  const image_t image_id = tables.priors.front().image_id1;
  SqliteStatement statement(
      database, "INSERT INTO adasfm_wheel_scale VALUES (?, ?, ?, ?, ?)");
  statement.BindInt(1, image_id);
  statement.BindText(2, names.Name(image_id));
  statement.BindDouble(3, tables.wheel_scale->scale);
  statement.BindDouble(4, tables.wheel_scale->sigma);
  statement.BindDouble(5, tables.wheel_scale->stated_sigma);
  statement.Step();
}

void WritePositionOrigin(const std::optional<GeodeticPosition>& origin,
                         SqliteConnection* database) {
  database->Execute("DELETE FROM adasfm_meta WHERE key = 'position_origin'");
  if (!origin.has_value()) return;
  char text[96];
  std::snprintf(text, sizeof(text), "%.17g %.17g %.17g", origin->latitude_deg,
                origin->longitude_deg, origin->height_m);
  SqliteStatement statement(database, "INSERT INTO adasfm_meta VALUES (?, ?)");
  statement.BindText(1, "position_origin");
  statement.BindText(2, text);
  statement.Step();
}

}  // namespace

void CreateMetaTable(SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_meta ("
      "key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL);"
      "INSERT OR IGNORE INTO adasfm_meta VALUES ('schema_version', '" +
      std::to_string(kSchemaVersion) + "');");
  CheckMetaTable(database);
}

void CheckMetaTable(SqliteConnection* database) {
  if (!database->HasTable("adasfm_meta")) return;
  SqliteStatement statement(
      database, "SELECT value FROM adasfm_meta WHERE key = 'schema_version'");
  const std::string version = statement.Step() ? statement.Text(0) : "none";
  if (version == std::to_string(kSchemaVersion)) return;
  throw SqliteError("the adasfm_ tables have schema version " + version +
                    ", this program knows " + std::to_string(kSchemaVersion));
}

Status WritePriorTables(const std::string& database_path,
                        const PriorTables& tables) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    const ImageNames names(&database);
    CreateTables(&database);
    for (const char* table : kTables) {
      database.Execute(std::string("DELETE FROM ") + table);
    }
    WriteImageTimes(names, tables.image_times, &database);
    WritePriors(names, tables.priors, &database);
    WriteTimeShiftEffects(names, tables, &database);
    WriteGravity(names, tables.gravity, &database);
    WritePositions(names, tables.positions, &database);
    WriteGyroscopeBias(names, tables, &database);
    WriteLengthDrift(names, tables, &database);
    WriteWheelScale(names, tables, &database);
    WriteInertialMotions(names, tables.inertial_motions, &database);
    WritePositionOrigin(tables.position_origin, &database);
    WriteRigCameras(tables.rig_cameras, &database);
    RemovePriorCorrections(&database);
    transaction.Commit();
  } catch (const SqliteError& error) {
    return Status::Error("cannot write the priors to " + database_path + ": " +
                         error.what() + "; the database is as it was");
  }
  return Status::Ok();
}

void RemovePriorTables(SqliteConnection* database) {
  for (const char* table : kTables) {
    database->Execute(std::string("DROP TABLE IF EXISTS ") + table);
  }
  database->Execute("DROP TABLE IF EXISTS adasfm_inertial_motions");
  if (database->HasTable("adasfm_meta")) WritePositionOrigin({}, database);
  WriteRigCameras({}, database);
  RemovePriorCorrections(database);
}

}  // namespace adasfm
