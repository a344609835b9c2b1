// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/prior_corrections.h"

#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "colmap_ext/double_blob.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/prior_tables.h"

namespace adasfm {
namespace {

constexpr char kTable[] = "adasfm_prior_corrections";

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

}  // namespace

void WritePriorCorrections(const std::vector<RelativePosePrior>& priors,
                           SqliteConnection* database) {
  RemovePriorCorrections(database);
  if (priors.empty()) return;
  CreateMetaTable(database);
  database->Execute(
      "CREATE TABLE adasfm_prior_corrections ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, qvec BLOB NOT NULL, "
      "PRIMARY KEY (image_id1, image_id2))");
  const std::map<image_t, std::string> names = ReadNames(database);
  SqliteStatement statement(
      database, "INSERT INTO adasfm_prior_corrections VALUES (?, ?, ?, ?, ?)");
  for (const RelativePosePrior& prior : priors) {
    const Eigen::Quaterniond& q = prior.cam2_from_cam1.rotation;
    const Eigen::Vector4d qvec(q.w(), q.x(), q.y(), q.z());
    statement.Reset();
    statement.BindInt(1, prior.image_id1);
    statement.BindInt(2, prior.image_id2);
    statement.BindText(3, NameOf(names, prior.image_id1));
    statement.BindText(4, NameOf(names, prior.image_id2));
    BindDoubles(&statement, 5, qvec.data(), 4);
    statement.Step();
  }
}

bool HasPriorCorrections(SqliteConnection* database) {
  return database->HasTable(kTable);
}

void RemovePriorCorrections(SqliteConnection* database) {
  database->Execute(std::string("DROP TABLE IF EXISTS ") + kTable);
}

void ApplyPriorCorrections(SqliteConnection* database,
                           std::vector<RelativePosePrior>* priors) {
  if (!HasPriorCorrections(database)) return;
  std::map<std::pair<std::string, std::string>, Eigen::Quaterniond> rotations;
  SqliteStatement statement(
      database, std::string("SELECT name1, name2, qvec FROM ") + kTable);
  while (statement.Step()) {
    const std::string row = std::string("table ") + kTable + ", images " +
                            statement.Text(0) + " and " + statement.Text(1);
    Eigen::Vector4d qvec;
    DoublesFromBlob(statement, 2, row, 4, qvec.data());
    if (!(std::abs(qvec.norm() - 1.0) < 1e-6)) {
      throw SqliteError(row + ": not a rotation");
    }
    rotations[{statement.Text(0), statement.Text(1)}] =
        Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3));
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
