// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/io/double_blob.h"
#include "global/calibration/correct_camera_imu_rotation.h"

namespace adasfm {
namespace {

constexpr char kCorrectionTable[] = "adasfm_camera_mount";

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

void WriteCameraImuCorrection(const Eigen::Quaterniond& camera_imu_correction,
                              SqliteConnection* database) {
  database->Execute("CREATE TABLE adasfm_camera_mount (qvec BLOB NOT NULL)");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_camera_mount VALUES (?)");
  BindDoubles(&statement, 1, ToQvec(camera_imu_correction).data(), 4);
  statement.Step();
}

}  // namespace

void WritePriorCorrections(
    const std::optional<Eigen::Quaterniond>& camera_imu_correction,
    const std::vector<InertialLength>& lengths, SqliteConnection* database) {
  RemovePriorCorrections(database);
  if (!camera_imu_correction && lengths.empty()) return;
  CreateMetaTable(database);
  if (camera_imu_correction)
    WriteCameraImuCorrection(*camera_imu_correction, database);
  WriteInertialLengths(lengths, database);
}

bool HasPriorCorrections(SqliteConnection* database) {
  return database->HasTable(kCorrectionTable) ||
         database->HasTable(kInertialLengthTable);
}

void RemovePriorCorrections(SqliteConnection* database) {
  for (const char* table : {kCorrectionTable, kInertialLengthTable}) {
    database->Execute(std::string("DROP TABLE IF EXISTS ") + table);
  }
}

std::optional<Eigen::Quaterniond> ReadCameraImuCorrection(
    SqliteConnection* database) {
  if (!database->HasTable(kCorrectionTable)) return std::nullopt;
  SqliteStatement statement(
      database, std::string("SELECT qvec FROM ") + kCorrectionTable);
  if (!statement.Step()) return std::nullopt;
  return ReadRotation(statement, 0, std::string("table ") + kCorrectionTable);
}

double ApplyPriorCorrections(SqliteConnection* database,
                             std::vector<RelativePosePrior>* priors) {
  if (const auto camera_imu_correction = ReadCameraImuCorrection(database)) {
    for (RelativePosePrior& prior : *priors)
      RotatePrior(*camera_imu_correction, &prior);
  }
  return AddInertialLengths(ReadInertialLengths(database), priors);
}

}  // namespace adasfm
