// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/double_blob.h"
#include "global/calibration/correct_camera_mount.h"

namespace adasfm {
namespace {

constexpr char kTable[] = "adasfm_prior_corrections";
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

std::map<image_t, std::string> ReadNames(SqliteConnection* database) {
  std::map<image_t, std::string> names;
  for (DatabaseImage& image : ReadImages(database)) {
    names[image.image_id] = std::move(image.name);
  }
  return names;
}

const std::string& NameOf(const std::map<image_t, std::string>& names,
                          image_t image_id) {
  const auto name = names.find(image_id);
  if (name != names.end()) return name->second;
  throw SqliteError("no image with the id " + std::to_string(image_id));
}

void WriteRotations(const std::vector<RelativePosePrior>& priors,
                    SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE adasfm_prior_corrections ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, qvec BLOB NOT NULL, "
      "PRIMARY KEY (image_id1, image_id2))");
  const std::map<image_t, std::string> names = ReadNames(database);
  SqliteStatement statement(
      database, "INSERT INTO adasfm_prior_corrections VALUES (?, ?, ?, ?, ?)");
  for (const RelativePosePrior& prior : priors) {
    statement.Reset();
    statement.BindInt(1, prior.image_id1);
    statement.BindInt(2, prior.image_id2);
    statement.BindText(3, NameOf(names, prior.image_id1));
    statement.BindText(4, NameOf(names, prior.image_id2));
    BindDoubles(&statement, 5, ToQvec(prior.cam2_from_cam1.rotation).data(), 4);
    statement.Step();
  }
}

}  // namespace

void WritePriorCorrections(const PriorCorrections& corrections,
                           SqliteConnection* database) {
  RemovePriorCorrections(database);
  if (corrections.priors.empty() && !corrections.camera_mount) return;
  CreateMetaTable(database);
  if (corrections.camera_mount) {
    WriteCameraMount(*corrections.camera_mount, database);
  }
  if (!corrections.priors.empty()) {
    WriteRotations(corrections.priors, database);
  }
}

bool HasPriorCorrections(SqliteConnection* database) {
  return database->HasTable(kTable) || database->HasTable(kMountTable);
}

void RemovePriorCorrections(SqliteConnection* database) {
  for (const char* table : {kTable, kMountTable}) {
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

void ApplyPriorCorrections(SqliteConnection* database,
                           std::vector<RelativePosePrior>* priors) {
  if (const auto camera_mount = ReadCameraMount(database)) {
    for (RelativePosePrior& prior : *priors) TurnPrior(*camera_mount, &prior);
  }
  if (!database->HasTable(kTable)) return;
  std::map<std::pair<std::string, std::string>, Eigen::Quaterniond> rotations;
  SqliteStatement statement(
      database, std::string("SELECT name1, name2, qvec FROM ") + kTable);
  while (statement.Step()) {
    const std::string row = std::string("table ") + kTable + ", images " +
                            statement.Text(0) + " and " + statement.Text(1);
    rotations[{statement.Text(0), statement.Text(1)}] =
        ReadRotation(statement, 2, row);
  }
  const std::map<image_t, std::string> names = ReadNames(database);
  for (RelativePosePrior& prior : *priors) {
    const auto rotation = rotations.find(
        {NameOf(names, prior.image_id1), NameOf(names, prior.image_id2)});
    if (rotation == rotations.end()) continue;
    prior.cam2_from_cam1.rotation = rotation->second;
  }
}

}  // namespace adasfm
