// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_schema.h"

#include <algorithm>
#include <filesystem>
#include <map>

namespace adasfm {
namespace {

// Columns that COLMAP 3.6 and all later versions have.
const std::map<std::string, std::vector<std::string>>& RequiredColumns() {
  static const std::map<std::string, std::vector<std::string>> columns = {
      {"cameras", {"camera_id", "model", "width", "height", "params"}},
      {"images", {"image_id", "name", "camera_id"}},
      {"keypoints", {"image_id", "rows", "cols", "data"}},
      {"matches", {"pair_id", "rows", "cols", "data"}},
      {"two_view_geometries",
       {"pair_id", "rows", "cols", "data", "config", "F", "E", "H"}},
  };
  return columns;
}

bool Contains(const std::vector<std::string>& columns,
              const std::string& column) {
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

}  // namespace

bool HasColumn(SqliteConnection* database, const std::string& table,
               const std::string& column) {
  return Contains(database->Columns(table), column);
}

Status CheckColumns(const std::string& path, SqliteConnection* database) {
  for (const auto& [table, required] : RequiredColumns()) {
    const std::vector<std::string> columns = database->Columns(table);
    for (const std::string& column : required) {
      if (Contains(columns, column)) continue;
      const std::string missing =
          columns.empty() ? "table " + table : "column " + table + "." + column;
      return Status::Error(path + " is not a database of COLMAP: " + missing +
                           " is missing; check --database_path");
    }
  }
  return Status::Ok();
}

std::vector<std::string> FindNewerTables(SqliteConnection* database) {
  std::vector<std::string> tables;
  // COLMAP 3.10 moved the pose priors out of the images, 3.12 added rigs.
  for (const char* table : {"pose_priors", "rigs", "frames"}) {
    if (database->HasTable(table)) tables.push_back(table);
  }
  return tables;
}

bool IsHalfConvertible(SqliteConnection* database) {
  return HasColumn(database, "pose_priors", "image_id") &&
         !HasColumn(database, "pose_priors", "position_covariance");
}

Status CheckLibraryOpens(const std::string& database_path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(database_path, error);
  if (error || size == 0) return Status::Ok();
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    const std::string reason = WhyLibraryMustNotOpen(&database);
    return reason.empty() ? Status::Ok()
                          : Status::Error(database_path + reason);
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  }
}

bool StoresMissingAsNull(SqliteConnection* database) {
  return HasColumn(database, "descriptors", "type");
}

void AddPoseColumns(SqliteConnection* database) {
  for (const std::string column : {"qvec", "tvec"}) {
    if (HasColumn(database, "two_view_geometries", column)) continue;
    database->Execute("ALTER TABLE two_view_geometries ADD COLUMN " + column +
                      " BLOB");
  }
}

}  // namespace adasfm
