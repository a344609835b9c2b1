// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/inertial_tables.h"

#include <cmath>
#include <map>
#include <string>

#include "colmap_ext/host/database.h"
#include "colmap_ext/io/double_blob.h"

namespace adasfm {
namespace {

// The first four columns of both tables, and back.
class PairOfImages {
 public:
  explicit PairOfImages(SqliteConnection* database) {
    for (const DatabaseImage& image : ReadImages(database)) {
      names_[image.image_id] = image.name;
      ids_[image.name] = image.image_id;
    }
  }

  void Bind(image_t image_id1, image_t image_id2,
            SqliteStatement* statement) const {
    statement->BindInt(1, image_id1);
    statement->BindInt(2, image_id2);
    statement->BindText(3, Name(image_id1));
    statement->BindText(4, Name(image_id2));
  }

  // By the names, which are the first two columns that were selected; false
  // when the database lacks one.
  bool Resolve(const SqliteStatement& statement, image_t* image_id1,
               image_t* image_id2) const {
    const auto id1 = ids_.find(statement.Text(0));
    const auto id2 = ids_.find(statement.Text(1));
    if (id1 == ids_.end() || id2 == ids_.end()) return false;
    *image_id1 = id1->second;
    *image_id2 = id2->second;
    return true;
  }

 private:
  const std::string& Name(image_t image_id) const {
    const auto name = names_.find(image_id);
    if (name != names_.end()) return name->second;
    throw SqliteError("no image with the id " + std::to_string(image_id));
  }

  std::map<image_t, std::string> names_;
  std::map<std::string, image_t> ids_;
};

std::string RowOf(const std::string& table, const SqliteStatement& statement) {
  return "table " + table + ", images " + statement.Text(0) + " and " +
         statement.Text(1);
}

bool IsPositive(double value) { return std::isfinite(value) && value > 0.0; }

void MotionFromRow(const SqliteStatement& statement, InertialMotion* motion) {
  const std::string row = RowOf("adasfm_inertial_motions", statement);
  motion->dt_s = statement.Double(2);
  DoublesFromBlob(statement, 3, row, 3, motion->delta_velocity.data());
  DoublesFromBlob(statement, 4, row, 3, motion->delta_position.data());
  DoublesFromBlob(statement, 5, row, 9, motion->velocity_by_bias.data());
  DoublesFromBlob(statement, 6, row, 9, motion->position_by_bias.data());
  DoublesFromBlob(statement, 7, row, 3, motion->camera_from_imu_origin.data());
  // Rows first.
  motion->velocity_by_bias.transposeInPlace();
  motion->position_by_bias.transposeInPlace();
  if (!IsPositive(motion->dt_s) || !motion->delta_velocity.allFinite() ||
      !motion->delta_position.allFinite() ||
      !motion->velocity_by_bias.allFinite() ||
      !motion->position_by_bias.allFinite() ||
      !motion->camera_from_imu_origin.allFinite()) {
    throw SqliteError(row + ": values that no IMU integrates");
  }
}

}  // namespace

void WriteInertialMotions(const std::vector<InertialMotion>& motions,
                          SqliteConnection* database) {
  if (database->HasTable("adasfm_inertial_motions")) {
    database->Execute("DELETE FROM adasfm_inertial_motions");
  }
  if (motions.empty()) return;
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_inertial_motions ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, dt_s REAL NOT NULL, "
      "delta_velocity BLOB NOT NULL, delta_position BLOB NOT NULL, "
      "velocity_by_bias BLOB NOT NULL, position_by_bias BLOB NOT NULL, "
      "camera_from_imu_origin BLOB NOT NULL, "
      "PRIMARY KEY (image_id1, image_id2))");
  const PairOfImages images(database);
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_inertial_motions VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const InertialMotion& motion : motions) {
    // Rows first.
    const Eigen::Matrix3d velocity_rows = motion.velocity_by_bias.transpose();
    const Eigen::Matrix3d position_rows = motion.position_by_bias.transpose();
    statement.Reset();
    images.Bind(motion.image_id1, motion.image_id2, &statement);
    statement.BindDouble(5, motion.dt_s);
    BindDoubles(&statement, 6, motion.delta_velocity.data(), 3);
    BindDoubles(&statement, 7, motion.delta_position.data(), 3);
    BindDoubles(&statement, 8, velocity_rows.data(), 9);
    BindDoubles(&statement, 9, position_rows.data(), 9);
    BindDoubles(&statement, 10, motion.camera_from_imu_origin.data(), 3);
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
      "PRIMARY KEY (image_id1, image_id2))");
  const PairOfImages images(database);
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_inertial_lengths VALUES "
                            "(?, ?, ?, ?, ?, ?, ?)");
  for (const InertialLength& length : lengths) {
    statement.Reset();
    images.Bind(length.image_id1, length.image_id2, &statement);
    statement.BindDouble(5, length.length_m);
    statement.BindDouble(6, length.sigma_m);
    statement.BindDouble(7, length.scale_sigma);
    statement.Step();
  }
}

std::vector<InertialMotion> ReadInertialMotions(SqliteConnection* database,
                                                int* num_ignored_rows) {
  std::vector<InertialMotion> motions;
  if (!database->HasTable("adasfm_inertial_motions")) return motions;
  const PairOfImages images(database);
  SqliteStatement statement(
      database,
      "SELECT name1, name2, dt_s, delta_velocity, delta_position, "
      "velocity_by_bias, position_by_bias, camera_from_imu_origin "
      "FROM adasfm_inertial_motions ORDER BY rowid");
  while (statement.Step()) {
    InertialMotion motion;
    if (!images.Resolve(statement, &motion.image_id1, &motion.image_id2)) {
      ++*num_ignored_rows;
      continue;
    }
    MotionFromRow(statement, &motion);
    motions.push_back(motion);
  }
  return motions;
}

std::vector<InertialLength> ReadInertialLengths(SqliteConnection* database) {
  std::vector<InertialLength> lengths;
  if (!database->HasTable(kInertialLengthTable)) return lengths;
  const PairOfImages images(database);
  SqliteStatement statement(
      database,
      "SELECT name1, name2, length_m, sigma_m, scale_sigma "
      "FROM adasfm_inertial_lengths ORDER BY rowid");
  while (statement.Step()) {
    InertialLength length;
    if (!images.Resolve(statement, &length.image_id1, &length.image_id2)) {
      continue;
    }
    length.length_m = statement.Double(2);
    length.sigma_m = statement.Double(3);
    length.scale_sigma = statement.Double(4);
    if (!std::isfinite(length.length_m) || length.length_m < 0.0 ||
        !IsPositive(length.sigma_m) || !IsPositive(length.scale_sigma)) {
      throw SqliteError(RowOf(kInertialLengthTable, statement) +
                        ": values that are not a length");
    }
    lengths.push_back(length);
  }
  return lengths;
}

}  // namespace adasfm
