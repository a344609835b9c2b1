// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <system_error>

#include "colmap_ext/host/database_schema.h"

namespace adasfm {

Status CheckLibraryOpens(const std::string& database_path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(database_path, error);
  if (error || size == 0) return Status::Ok();
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    // COLMAP 4 turns all other files into its own form; these it leaves half
    // converted.
    if (!database.HasTable("pose_priors") ||
        HasColumn(&database, "pose_priors", "position_covariance")) {
      return Status::Ok();
    }
    return Status::Error(
        database_path +
        " was written by COLMAP 3.10, whose pose_priors COLMAP 4 cannot read; "
        "add the column position_covariance BLOB to that table");
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  }
}

}  // namespace adasfm
