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
    const std::vector<std::string> tables = FindNewerTables(&database);
    if (tables.empty()) return Status::Ok();
    return Status::Error(
        database_path + " was written by a newer COLMAP (it has the table " +
        tables.front() +
        "), and this program extracts and matches with COLMAP 3.8's library, "
        "which would damage it; set ADASFM_HOST_COLMAP to the COLMAP that "
        "made it");
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  }
}

}  // namespace adasfm
