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

}  // namespace

const std::vector<std::string>& DatabaseForms() {
  static const std::vector<std::string> forms = {
      "3.6",  "3.7",  "3.8", "3.9", "3.10", "3.11",
      "3.12", "3.13", "4.0", "4.1", "4.2",  "4.2, other frames"};
  return forms;
}

void ReshapeDatabase(const std::string& path, const std::string& form) {
  const auto& forms = DatabaseForms();
  const size_t index =
      std::find(forms.begin(), forms.end(), form) - forms.begin();
  const auto since = [&](const std::string& version) {
    return index >=
           std::find(forms.begin(), forms.end(), version) - forms.begin();
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

}  // namespace adasfm
