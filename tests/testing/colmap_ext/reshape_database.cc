// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/colmap_ext/reshape_database.h"

#include <algorithm>

#include "core/sqlite.h"

namespace adasfm {
namespace {

void DropPosePriorsOfImages(SqliteConnection* database) {
  for (const char* value : {"qw", "qx", "qy", "qz", "tx", "ty", "tz"}) {
    database->Execute(std::string("ALTER TABLE images DROP COLUMN prior_") +
                      value);
  }
}

void AddFrames(int64_t id_offset, SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY, ref_sensor_id INTEGER "
      "NOT NULL, ref_sensor_type INTEGER NOT NULL);"
      "CREATE TABLE rig_sensors (rig_id INTEGER NOT NULL, sensor_id INTEGER "
      "NOT NULL, sensor_type INTEGER NOT NULL, sensor_from_rig BLOB);"
      "CREATE TABLE frames (frame_id INTEGER PRIMARY KEY, rig_id INTEGER NOT "
      "NULL);"
      "CREATE TABLE frame_data (frame_id INTEGER NOT NULL, data_id INTEGER NOT "
      "NULL, sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL);"
      "INSERT INTO rigs SELECT camera_id, camera_id, 0 FROM cameras;");
  const std::string frame_id = "image_id + " + std::to_string(id_offset);
  database->Execute("INSERT INTO frames SELECT " + frame_id +
                    ", camera_id FROM images; INSERT INTO frame_data SELECT " +
                    frame_id + ", image_id, camera_id, 0 FROM images;");
}

void AddPosePriors(const std::string& columns, SqliteConnection* database) {
  database->Execute("CREATE TABLE pose_priors (" + columns + ")");
}

// The poses that mean "none": zeros up to 3.8, the identity up to 3.13.
void ClearPoses(const std::string& form, size_t index,
                SqliteConnection* database) {
  if (form == "3.6") {
    database->Execute(
        "ALTER TABLE two_view_geometries DROP COLUMN qvec;"
        "ALTER TABLE two_view_geometries DROP COLUMN tvec;"
        "UPDATE two_view_geometries SET F = zeroblob(72), H = zeroblob(72);");
  } else if (index < 3) {
    database->Execute(
        "UPDATE two_view_geometries SET qvec = X'0000000000000000"
        "000000000000008000000000000000800000000000000080', "
        "tvec = zeroblob(24), F = zeroblob(72), H = zeroblob(72);");
  } else if (form[0] == '3') {
    database->Execute(
        "UPDATE two_view_geometries SET qvec = X'000000000000F03F"
        "000000000000000000000000000000000000000000000000', "
        "tvec = zeroblob(24), F = zeroblob(72), H = zeroblob(72);");
  } else {
    database->Execute(
        "UPDATE two_view_geometries SET qvec = NULL, tvec = NULL, F = NULL, "
        "H = NULL;");
  }
}

std::string Repeat(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

void AddMissingColumns(const std::string& table,
                       const std::vector<std::string>& definitions,
                       SqliteConnection* database) {
  const std::vector<std::string> columns = database->Columns(table);
  for (const std::string& definition : definitions) {
    const std::string name = definition.substr(0, definition.find(' '));
    if (std::find(columns.begin(), columns.end(), name) == columns.end()) {
      database->Execute("ALTER TABLE " + table + " ADD COLUMN " + definition);
    }
  }
}

}  // namespace

const std::vector<std::string>& DatabaseForms() {
  static const std::vector<std::string> forms = {
      "3.6",  "3.7",  "3.8", "3.9", "3.10", "3.11",
      "3.12", "3.13", "4.0", "4.1", "4.2",  "4.2, other frames"};
  return forms;
}

void ReshapeDatabase(const std::string& path, const std::string& form) {
  const auto& forms = DatabaseForms();
  const auto index_of = [&forms](const std::string& version) {
    return static_cast<size_t>(std::find(forms.begin(), forms.end(), version) -
                               forms.begin());
  };
  const size_t index = index_of(form);
  const auto since = [&](const std::string& version) {
    return index >= index_of(version);
  };
  SqliteConnection database(path, SqliteConnection::Mode::kWrite);
  database.Execute("PRAGMA foreign_keys = OFF;");
  ClearPoses(form, index, &database);
  if (since("3.10")) DropPosePriorsOfImages(&database);
  if (since("4.0")) {
    AddPosePriors(
        "pose_prior_id INTEGER PRIMARY KEY, corr_data_id INTEGER, "
        "corr_sensor_id INTEGER, corr_sensor_type INTEGER, position BLOB, "
        "position_covariance BLOB, gravity BLOB, coordinate_system INTEGER",
        &database);
    database.Execute(
        "ALTER TABLE descriptors ADD COLUMN type INTEGER NOT NULL DEFAULT 0;");
  } else if (since("3.10")) {
    AddPosePriors(std::string("image_id INTEGER PRIMARY KEY, position BLOB, "
                              "coordinate_system INTEGER NOT NULL") +
                      (since("3.11") ? ", position_covariance BLOB" : ""),
                  &database);
  }
  if (since("3.12")) {
    AddFrames(form == "4.2, other frames" ? 100 : 0, &database);
  }
  if (since("4.2")) {
    database.Execute(
        "ALTER TABLE two_view_geometries ADD COLUMN camera1 BLOB;"
        "ALTER TABLE two_view_geometries ADD COLUMN camera2 BLOB;");
  }
  const char* version = since("4.2")   ? "4020100"
                        : since("4.1") ? "4010000"
                        : since("4.0") ? "4000000"
                        : since("3.9") ? "3900"
                        : since("3.7") ? "3800"
                                       : "3600";
  database.Execute(std::string("PRAGMA user_version = ") + version);
}

void MakeStereoRig(const std::string& path, int num_frames,
                   const std::string& sensor_from_rig) {
  SqliteConnection database(path, SqliteConnection::Mode::kWrite);
  const std::string n = std::to_string(num_frames);
  database.Execute("UPDATE frame_data SET frame_id = frame_id - " + n +
                   " WHERE data_id > " + n +
                   ";DELETE FROM frames WHERE frame_id NOT IN "
                   "(SELECT frame_id FROM frame_data);"
                   "DELETE FROM rigs WHERE rig_id = 2;");
  SqliteStatement statement(&database,
                            "INSERT INTO rig_sensors VALUES (1, 2, 0, ?)");
  if (!sensor_from_rig.empty()) {
    statement.BindBlob(1, sensor_from_rig.data(), sensor_from_rig.size());
  }
  statement.Step();
}

void MigrateToColmap4(const std::string& path) {
  SqliteConnection database(path, SqliteConnection::Mode::kWrite);
  AddMissingColumns("two_view_geometries",
                    {"qvec BLOB", "tvec BLOB", "camera1 BLOB", "camera2 BLOB"},
                    &database);
  AddMissingColumns("descriptors", {"type INTEGER NOT NULL DEFAULT 0"},
                    &database);
  if (!database.HasTable("frames")) AddFrames(0, &database);
  // Doubles as hexadecimal text.
  const std::string zero = "0000000000000000";
  const std::string negative_zero = "0000000000000080";
  database.Execute(
      "UPDATE two_view_geometries SET qvec = NULL, tvec = NULL WHERE "
      "hex(qvec) IN ('', '" +
      Repeat(zero, 4) + "', '" + zero + Repeat(negative_zero, 3) +
      "') OR (hex(qvec) = '000000000000F03F" + Repeat(zero, 3) +
      "' AND tvec = zeroblob(24));");
  for (const std::string matrix : {"F", "E", "H"}) {
    database.Execute("UPDATE two_view_geometries SET " + matrix +
                     " = NULL WHERE " + matrix + " IN (X'', zeroblob(72));");
  }
  database.Execute("PRAGMA user_version = 4020100;");
}

}  // namespace adasfm
