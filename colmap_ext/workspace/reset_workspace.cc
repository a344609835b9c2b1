// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/reset_workspace.h"

#include <filesystem>
#include <vector>

#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/workspace/early_database.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

Status Remove(const std::string& path) {
  std::error_code error;
  fs::remove_all(path, error);
  if (!error) return Status::Ok();
  return Status::Error("cannot remove " + path + ": " + error.message());
}

// Executes all statements and `rest` in one transaction.
Status Execute(const std::string& database_path,
               const std::vector<std::string>& statements,
               void (*rest)(SqliteConnection*)) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    for (const std::string& statement : statements) {
      database.Execute(statement);
    }
    rest(&database);
    transaction.Commit();
    return Status::Ok();
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
}

}  // namespace

Status ResetFeatures(const std::string& workspace_path) {
  for (const char* name :
       {"database.db", "database.db-wal", "database.db-shm",
        "database.db.priors.json", "coarse", "sparse", "report.html"}) {
    const Status status = Remove(workspace_path + "/" + name);
    if (!status.ok()) return status;
  }
  return RemoveEarlyDatabase(EarlyDatabasePath(workspace_path));
}

Status ResetMatches(const std::string& database_path) {
  return Execute(database_path,
                 {"DELETE FROM matches", "DELETE FROM two_view_geometries",
                  "DROP TABLE IF EXISTS adasfm_two_view_geometries"},
                 RemovePriorCorrections);
}

Status ResetPriors(const std::string& database_path) {
  const Status status = Remove(database_path + ".priors.json");
  if (!status.ok()) return status;
  return Execute(database_path, {}, RemovePriorTables);
}

}  // namespace adasfm
