// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

constexpr char kCorrectionTable[] = "adasfm_camera_mount";
constexpr char kTimeShiftTable[] = "adasfm_time_shifts";
constexpr char kGyroscopeScaleTable[] = "adasfm_gyroscope_scales";

std::array<double, 4> ToQvec(const Eigen::Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

Eigen::Quaterniond ReadRotation(const SqliteStatement& statement, int column,
                                const std::string& row) {
  Eigen::Vector4d qvec;
  DoublesFromBlob(statement, column, row, 4, qvec.data());
  if (!(std::abs(qvec.norm() - 1.0) < 1e-6)) {
    throw SqliteError(row + ": not a rotation");
  }
  return Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3));
}

void WriteCameraImuCorrections(
    const std::map<camera_t, Eigen::Quaterniond>& camera_imu_corrections,
    SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE adasfm_camera_mount (camera_id INTEGER NOT NULL, qvec BLOB "
      "NOT NULL)");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_camera_mount VALUES (?, ?)");
  for (const auto& [camera_id, rotation] : camera_imu_corrections) {
    statement.Reset();
    statement.BindInt(1, camera_id);
    BindDoubles(&statement, 2, ToQvec(rotation).data(), 4);
    statement.Step();
  }
}

void WriteTimeShifts(const std::map<camera_t, double>& time_shift_s,
                     SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE adasfm_time_shifts (camera_id INTEGER NOT NULL, shift_s "
      "REAL NOT NULL)");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_time_shifts VALUES (?, ?)");
  for (const auto& [camera_id, shift_s] : time_shift_s) {
    statement.Reset();
    statement.BindInt(1, camera_id);
    statement.BindDouble(2, shift_s);
    statement.Step();
  }
}

void WriteGyroscopeScales(const std::map<camera_t, Eigen::Vector3d>& scales,
                          SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE adasfm_gyroscope_scales (camera_id INTEGER NOT NULL, "
      "scales BLOB NOT NULL)");
  SqliteStatement statement(
      database, "INSERT INTO adasfm_gyroscope_scales VALUES (?, ?)");
  for (const auto& [camera_id, values] : scales) {
    statement.Reset();
    statement.BindInt(1, camera_id);
    BindDoubles(&statement, 2, values.data(), 3);
    statement.Step();
  }
}

}  // namespace

void WritePriorCorrections(const PriorCorrections& corrections,
                           SqliteConnection* database) {
  RemovePriorCorrections(database);
  if (corrections.camera_imu.empty() && corrections.time_shift_s.empty() &&
      corrections.gyroscope_scales.empty() && corrections.lengths.empty()) {
    return;
  }
  CreateMetaTable(database);
  if (!corrections.camera_imu.empty()) {
    WriteCameraImuCorrections(corrections.camera_imu, database);
  }
  if (!corrections.time_shift_s.empty()) {
    WriteTimeShifts(corrections.time_shift_s, database);
  }
  if (!corrections.gyroscope_scales.empty()) {
    WriteGyroscopeScales(corrections.gyroscope_scales, database);
  }
  WriteInertialLengths(corrections.lengths, database);
}

bool HasPriorCorrections(SqliteConnection* database) {
  return database->HasTable(kCorrectionTable) ||
         database->HasTable(kTimeShiftTable) ||
         database->HasTable(kGyroscopeScaleTable) ||
         database->HasTable(kInertialLengthTable);
}

void RemovePriorCorrections(SqliteConnection* database) {
  for (const char* table : {kCorrectionTable, kTimeShiftTable,
                            kGyroscopeScaleTable, kInertialLengthTable}) {
    database->Execute(std::string("DROP TABLE IF EXISTS ") + table);
  }
}

std::map<camera_t, Eigen::Quaterniond> ReadCameraImuCorrections(
    SqliteConnection* database) {
  std::map<camera_t, Eigen::Quaterniond> corrections;
  if (!database->HasTable(kCorrectionTable)) return corrections;
  // Older versions wrote one correction for all cameras.
  const bool is_by_camera = database->Columns(kCorrectionTable).size() > 1;
  SqliteStatement statement(
      database, is_by_camera ? "SELECT camera_id, qvec FROM adasfm_camera_mount"
                             : "SELECT cameras.camera_id, qvec FROM cameras, "
                               "adasfm_camera_mount");
  while (statement.Step()) {
    corrections.emplace(
        static_cast<camera_t>(statement.Int(0)),
        ReadRotation(statement, 1, std::string("table ") + kCorrectionTable));
  }
  return corrections;
}

std::map<camera_t, double> ReadTimeShifts(SqliteConnection* database) {
  std::map<camera_t, double> shifts;
  if (!database->HasTable(kTimeShiftTable)) return shifts;
  SqliteStatement statement(
      database, "SELECT camera_id, shift_s FROM adasfm_time_shifts");
  while (statement.Step()) {
    const double shift_s = statement.Double(1);
    if (!std::isfinite(shift_s)) {
      throw SqliteError(std::string("table ") + kTimeShiftTable +
                        ": not a time");
    }
    shifts.emplace(static_cast<camera_t>(statement.Int(0)), shift_s);
  }
  return shifts;
}

std::map<camera_t, Eigen::Vector3d> ReadGyroscopeScales(
    SqliteConnection* database) {
  std::map<camera_t, Eigen::Vector3d> scales;
  if (!database->HasTable(kGyroscopeScaleTable)) return scales;
  const std::string row = std::string("table ") + kGyroscopeScaleTable;
  SqliteStatement statement(
      database, "SELECT camera_id, scales FROM adasfm_gyroscope_scales");
  while (statement.Step()) {
    Eigen::Vector3d values;
    DoublesFromBlob(statement, 1, row, 3, values.data());
    if (!values.allFinite()) throw SqliteError(row + ": not finite");
    scales.emplace(static_cast<camera_t>(statement.Int(0)), values);
  }
  return scales;
}

}  // namespace adasfm
