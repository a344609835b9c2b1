// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/inertial_tables.h"

#include <cmath>
#include <optional>
#include <string>
#include <tuple>

#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

std::string RowOf(const std::string& table, const SqliteStatement& statement) {
  return "table " + table + ", images " + statement.Text(0) + " and " +
         statement.Text(1);
}

// None where both columns are NULL.
std::optional<MeasuredTranslation> TranslationFromRow(
    const SqliteStatement& statement, int column, const std::string& row) {
  if (statement.IsNull(column) && statement.IsNull(column + 1)) {
    return std::nullopt;
  }
  MeasuredTranslation measured;
  DoublesFromBlob(statement, column, row, 3, measured.translation.data());
  DoublesFromBlob(statement, column + 1, row, 9, measured.covariance.data());
  if (!measured.translation.allFinite() || !measured.covariance.allFinite() ||
      !(measured.covariance.diagonal().array() >= 0.0).all()) {
    throw SqliteError(row + ": values that are no measured translation");
  }
  return measured;
}

void BindTranslation(const MeasuredTranslation& measured, int column,
                     SqliteStatement* statement) {
  BindDoubles(statement, column, measured.translation.data(), 3);
  BindDoubles(statement, column + 1, measured.covariance.data(), 9);
}

// Tables of older versions lack the columns of the wheels.
bool HasWheelColumns(SqliteConnection* database) {
  constexpr size_t kNumColumnsWithoutWheels = 10;
  return database->Columns("adasfm_inertial_motions").size() >
         kNumColumnsWithoutWheels;
}

// Tables of older versions lack the columns of bridges.
bool HasBridgeColumns(SqliteConnection* database) {
  constexpr size_t kNumColumnsWithoutBridges = 7;
  return database->Columns(kInertialLengthTable).size() >
         kNumColumnsWithoutBridges;
}

bool IsPositive(double value) { return std::isfinite(value) && value > 0.0; }

InertialMotion MotionFromRow(const SqliteStatement& statement) {
  const std::string row = RowOf("adasfm_inertial_motions", statement);
  InertialMotion motion;
  motion.dt_s = statement.Double(2);
  DoublesFromBlob(statement, 3, row, 3, motion.delta_velocity.data());
  DoublesFromBlob(statement, 4, row, 3, motion.delta_position.data());
  DoublesFromBlob(statement, 5, row, 9, motion.velocity_by_bias.data());
  DoublesFromBlob(statement, 6, row, 9, motion.position_by_bias.data());
  DoublesFromBlob(statement, 7, row, 3, motion.camera_from_imu_origin.data());
  // Stored row by row.
  motion.velocity_by_bias.transposeInPlace();
  motion.position_by_bias.transposeInPlace();
  motion.by_wheels = TranslationFromRow(statement, 8, row);
  if (!IsPositive(motion.dt_s) || !motion.delta_velocity.allFinite() ||
      !motion.delta_position.allFinite() ||
      !motion.velocity_by_bias.allFinite() ||
      !motion.position_by_bias.allFinite() ||
      !motion.camera_from_imu_origin.allFinite()) {
    throw SqliteError(row + ": values that no IMU integrates");
  }
  return motion;
}

}  // namespace

void WriteInertialMotions(const ImageNames& names,
                          const std::vector<InertialMotion>& motions,
                          SqliteConnection* database) {
  if (HasWheelColumns(database)) {
    database->Execute("DELETE FROM adasfm_inertial_motions");
  } else {
    database->Execute("DROP TABLE IF EXISTS adasfm_inertial_motions");
  }
  if (motions.empty()) return;
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_inertial_motions ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, dt_s REAL NOT NULL, "
      "delta_velocity BLOB NOT NULL, delta_position BLOB NOT NULL, "
      "velocity_by_bias BLOB NOT NULL, position_by_bias BLOB NOT NULL, "
      "camera_from_imu_origin BLOB NOT NULL, wheel_translation BLOB, "
      "wheel_covariance BLOB, "
      "PRIMARY KEY (image_id1, image_id2))");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_inertial_motions VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const InertialMotion& motion : motions) {
    // Stored row by row.
    const Eigen::Matrix3d velocity_rows = motion.velocity_by_bias.transpose();
    const Eigen::Matrix3d position_rows = motion.position_by_bias.transpose();
    statement.Reset();
    names.BindPair(motion.image_id1, motion.image_id2, &statement);
    statement.BindDouble(5, motion.dt_s);
    BindDoubles(&statement, 6, motion.delta_velocity.data(), 3);
    BindDoubles(&statement, 7, motion.delta_position.data(), 3);
    BindDoubles(&statement, 8, velocity_rows.data(), 9);
    BindDoubles(&statement, 9, position_rows.data(), 9);
    BindDoubles(&statement, 10, motion.camera_from_imu_origin.data(), 3);
    if (motion.by_wheels) BindTranslation(*motion.by_wheels, 11, &statement);
    statement.Step();
  }
}

void WriteInertialLengths(const std::vector<InertialLength>& lengths,
                          SqliteConnection* database) {
  database->Execute("DROP TABLE IF EXISTS adasfm_inertial_lengths");
  if (lengths.empty()) return;
  database->Execute(
      "CREATE TABLE adasfm_inertial_lengths ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, length_m REAL NOT NULL, "
      "sigma_m REAL NOT NULL, scale_sigma REAL NOT NULL, "
      "bridge_translation BLOB, bridge_covariance BLOB, "
      "PRIMARY KEY (image_id1, image_id2))");
  const ImageNames images(database);
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_inertial_lengths VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const InertialLength& length : lengths) {
    statement.Reset();
    images.BindPair(length.image_id1, length.image_id2, &statement);
    statement.BindDouble(5, length.length_m);
    statement.BindDouble(6, length.sigma_m);
    statement.BindDouble(7, length.scale_sigma);
    if (length.bridge) BindTranslation(*length.bridge, 8, &statement);
    statement.Step();
  }
}

std::vector<InertialMotion> ReadInertialMotions(const ImageNames& names,
                                                SqliteConnection* database,
                                                int* num_ignored_rows) {
  std::vector<InertialMotion> motions;
  if (!database->HasTable("adasfm_inertial_motions")) return motions;
  SqliteStatement statement(
      database,
      std::string(
          "SELECT name1, name2, dt_s, delta_velocity, delta_position, "
          "velocity_by_bias, position_by_bias, camera_from_imu_origin") +
          (HasWheelColumns(database) ? ", wheel_translation, wheel_covariance "
                                     : ", NULL, NULL ") +
          "FROM adasfm_inertial_motions ORDER BY rowid");
  while (statement.Step()) {
    const auto pair = names.Ids(statement);
    if (!pair) {
      ++*num_ignored_rows;
      continue;
    }
    InertialMotion motion = MotionFromRow(statement);
    std::tie(motion.image_id1, motion.image_id2) = *pair;
    motions.push_back(motion);
  }
  return motions;
}

std::vector<InertialLength> ReadInertialLengths(SqliteConnection* database) {
  std::vector<InertialLength> lengths;
  if (!database->HasTable(kInertialLengthTable)) return lengths;
  const ImageNames images(database);
  SqliteStatement statement(
      database,
      std::string("SELECT name1, name2, length_m, sigma_m, scale_sigma") +
          (HasBridgeColumns(database)
               ? ", bridge_translation, bridge_covariance "
               : ", NULL, NULL ") +
          "FROM adasfm_inertial_lengths ORDER BY rowid");
  while (statement.Step()) {
    const auto pair = images.Ids(statement);
    if (!pair) continue;
    InertialLength length;
    std::tie(length.image_id1, length.image_id2) = *pair;
    length.length_m = statement.Double(2);
    length.sigma_m = statement.Double(3);
    length.scale_sigma = statement.Double(4);
    const std::string row = RowOf(kInertialLengthTable, statement);
    length.bridge = TranslationFromRow(statement, 5, row);
    if (!std::isfinite(length.length_m) || length.length_m < 0.0 ||
        !IsPositive(length.sigma_m) || !IsPositive(length.scale_sigma)) {
      throw SqliteError(row + ": values that are not a length");
    }
    lengths.push_back(length);
  }
  return lengths;
}

}  // namespace adasfm
