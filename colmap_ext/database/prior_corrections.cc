// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/io/double_blob.h"
#include "global/calibration/correct_camera_mount.h"

namespace adasfm {
namespace {

constexpr char kMountTable[] = "adasfm_camera_mount";

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

void WriteCameraMount(const Eigen::Quaterniond& camera_mount,
                      SqliteConnection* database) {
  database->Execute("CREATE TABLE adasfm_camera_mount (qvec BLOB NOT NULL)");
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_camera_mount VALUES (?)");
  BindDoubles(&statement, 1, ToQvec(camera_mount).data(), 4);
  statement.Step();
}

}  // namespace

void WritePriorCorrections(
    const std::optional<Eigen::Quaterniond>& camera_mount,
    const std::vector<InertialLength>& lengths, SqliteConnection* database) {
  RemovePriorCorrections(database);
  if (!camera_mount && lengths.empty()) return;
  CreateMetaTable(database);
  if (camera_mount) WriteCameraMount(*camera_mount, database);
  WriteInertialLengths(lengths, database);
}

bool HasPriorCorrections(SqliteConnection* database) {
  return database->HasTable(kMountTable) ||
         database->HasTable(kInertialLengthTable);
}

void RemovePriorCorrections(SqliteConnection* database) {
  for (const char* table : {kMountTable, kInertialLengthTable}) {
    database->Execute(std::string("DROP TABLE IF EXISTS ") + table);
  }
}

std::optional<Eigen::Quaterniond> ReadCameraMount(SqliteConnection* database) {
  if (!database->HasTable(kMountTable)) return std::nullopt;
  SqliteStatement statement(database,
                            std::string("SELECT qvec FROM ") + kMountTable);
  if (!statement.Step()) return std::nullopt;
  return ReadRotation(statement, 0, std::string("table ") + kMountTable);
}

double ApplyPriorCorrections(SqliteConnection* database,
                             std::vector<RelativePosePrior>* priors) {
  if (const auto camera_mount = ReadCameraMount(database)) {
    for (RelativePosePrior& prior : *priors) TurnPrior(*camera_mount, &prior);
  }
  return AddInertialLengths(ReadInertialLengths(database), priors);
}

}  // namespace adasfm
