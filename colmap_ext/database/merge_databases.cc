// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/merge_databases.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "colmap_ext/database/merge_rows.h"
#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/output_files.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// COLMAP's tables, in the order in which rows refer to each other.
constexpr const char* kHostTables[] = {"cameras",
                                       "images",
                                       "rigs",
                                       "rig_sensors",
                                       "frames",
                                       "frame_data",
                                       "pose_priors",
                                       "keypoints",
                                       "descriptors",
                                       "matches",
                                       "two_view_geometries"};

bool IsOurs(const std::string& table) { return table.rfind("adasfm_", 0) == 0; }

std::vector<std::string> Tables(SqliteConnection* database) {
  SqliteStatement statement(database,
                            "SELECT name FROM sqlite_master WHERE type = "
                            "'table' AND name NOT LIKE 'sqlite_%' "
                            "ORDER BY name");
  std::vector<std::string> names;
  while (statement.Step()) names.push_back(statement.Text(0));
  return names;
}

// COLMAP's tables with their columns, as text to compare.
std::string DescribeTables(SqliteConnection* database) {
  std::string text;
  for (const char* table : kHostTables) {
    std::vector<std::string> columns = database->Columns(table);
    std::sort(columns.begin(), columns.end());
    text += std::string(columns.empty() ? "" : table) + " ";
    for (const std::string& column : columns) text += column + ",";
  }
  return text;
}

void CheckTables(SqliteConnection* database) {
  CheckMetaTable(database);
  for (const std::string& table : Tables(database)) {
    if (IsOurs(table) ||
        std::find(std::begin(kHostTables), std::end(kHostTables), table) !=
            std::end(kHostTables)) {
      continue;
    }
    throw SqliteError("the table " + table +
                      " is none that this program knows to merge");
  }
  if (database->HasTable(kTwoViewGeometryBackupTable) ||
      HasPriorCorrections(database)) {
    throw SqliteError(
        "adasfm_global has rewritten it; put the originals back with "
        "adasfm_restorer first");
  }
}

// Creates the tables and indices of another database that are missing here.
void CreateMissingTables(SqliteConnection* source, SqliteConnection* target) {
  SqliteStatement statement(
      source,
      "SELECT type, name, sql FROM sqlite_master WHERE sql IS NOT NULL AND "
      "name NOT LIKE 'sqlite_%' ORDER BY type DESC, name");
  while (statement.Step()) {
    SqliteStatement found(target, "SELECT 1 FROM sqlite_master WHERE name = ?");
    found.BindText(1, statement.Text(1));
    if (!found.Step()) target->Execute(statement.Text(2));
  }
}

int64_t UserVersion(SqliteConnection* database) {
  SqliteStatement statement(database, "PRAGMA user_version");
  return statement.Step() ? statement.Int(0) : 0;
}

int64_t CountRows(SqliteConnection* database, const std::string& table) {
  if (!database->HasTable(table)) return 0;
  SqliteStatement statement(database, "SELECT COUNT(*) FROM " + table);
  return statement.Step() ? statement.Int(0) : 0;
}

// Sorts by the first image's name, so that the order of the inputs does not
// matter.
void SortInputs(std::vector<DatabaseKeys>* inputs) {
  const auto first_name = [](const DatabaseKeys& keys) {
    std::string first;
    for (const auto& [id, image] : keys.images) {
      if (first.empty() || image.name < first) first = image.name;
    }
    return first;
  };
  std::vector<std::pair<std::string, size_t>> order;
  for (size_t i = 0; i < inputs->size(); ++i) {
    order.emplace_back(first_name((*inputs)[i]) + '\n' + (*inputs)[i].path, i);
  }
  std::sort(order.begin(), order.end());
  std::vector<DatabaseKeys> sorted;
  for (const auto& [name, i] : order) {
    sorted.push_back(std::move((*inputs)[i]));
  }
  *inputs = std::move(sorted);
}

void CheckSameTables(const std::vector<DatabaseKeys>& inputs,
                     const std::string& first_path,
                     const std::string& expected) {
  for (const DatabaseKeys& input : inputs) {
    SqliteConnection database(input.path, SqliteConnection::Mode::kRead);
    try {
      CheckTables(&database);
    } catch (const SqliteError& error) {
      throw SqliteError(input.path + ": " + error.what());
    }
    if (DescribeTables(&database) == expected) continue;
    throw SqliteError(first_path + " and " + input.path +
                      " were written by versions of COLMAP with different "
                      "tables; open the older one with the newer COLMAP "
                      "first, which converts it");
  }
}

// Runs within the caller's transaction.
int64_t MergeInto(const std::vector<DatabaseKeys>& inputs,
                  const std::vector<MergedIds>& ids, SqliteConnection* target) {
  int64_t num_new_rows = 0;
  for (size_t i = 0; i < inputs.size(); ++i) {
    SqliteConnection source(inputs[i].path, SqliteConnection::Mode::kRead);
    CreateMissingTables(&source, target);
    if (i == 0 && UserVersion(target) == 0) {
      target->Execute("PRAGMA user_version = " +
                      std::to_string(UserVersion(&source)));
    }
    std::vector<std::string> tables(std::begin(kHostTables),
                                    std::end(kHostTables));
    for (const std::string& table : Tables(&source)) {
      if (IsOurs(table)) tables.push_back(table);
    }
    for (const std::string& table : tables) {
      if (!source.HasTable(table)) continue;
      num_new_rows += MergeRows(table, inputs[i], ids[i], &source, target);
    }
  }
  return num_new_rows;
}

MergedDatabase Merge(const MergeDatabasesOptions& options,
                     const std::vector<DatabaseToMerge>& inputs,
                     const std::string& path, bool is_new) {
  std::vector<DatabaseKeys> keys;
  for (const DatabaseToMerge& input : inputs) {
    keys.push_back(ReadDatabaseKeys(input.path, input.prefix));
  }
  SortInputs(&keys);
  const std::string first_path = is_new ? keys.front().path : path;
  std::string expected;
  {
    SqliteConnection first(first_path, SqliteConnection::Mode::kRead);
    if (!is_new) CheckTables(&first);
    expected = DescribeTables(&first);
  }
  CheckSameTables(keys, first_path, expected);
  SqliteConnection database(path, SqliteConnection::Mode::kWrite);
  SqliteTransaction transaction(&database);
  const DatabaseKeys target =
      is_new ? DatabaseKeys() : ReadDatabaseKeys(path, "");
  const std::vector<MergedIds> ids =
      AssignMergedIds(target, keys, options.share_cameras);
  MergedDatabase merged;
  merged.num_new_rows = MergeInto(keys, ids, &database);
  merged.num_cameras = CountRows(&database, "cameras");
  merged.num_images = CountRows(&database, "images");
  merged.num_keypoint_rows = CountRows(&database, "keypoints");
  merged.num_match_rows = CountRows(&database, "matches");
  merged.num_verified_pairs = CountRows(&database, "two_view_geometries");
  transaction.Commit();
  return merged;
}

// An empty file that is renamed to the output when it is complete.
class TemporaryDatabase {
 public:
  explicit TemporaryDatabase(const std::string& path)
      : path_(path + ".part"), final_path_(path) {
    Remove();
    std::fclose(OpenFile());
  }
  ~TemporaryDatabase() { Remove(); }
  TemporaryDatabase(const TemporaryDatabase&) = delete;
  TemporaryDatabase& operator=(const TemporaryDatabase&) = delete;

  const std::string& Path() const { return path_; }

  void Finish() {
    Status status = SyncToDisk(path_);
    if (!status.ok()) throw SqliteError(status.message());
    fs::rename(path_, final_path_);
  }

 private:
  std::FILE* OpenFile() const {
    std::FILE* file = std::fopen(path_.c_str(), "wb");
    if (file == nullptr) throw SqliteError("cannot create " + path_);
    return file;
  }
  void Remove() {
    std::error_code ignored;
    fs::remove(path_, ignored);
    fs::remove(path_ + "-journal", ignored);
  }

  std::string path_;
  std::string final_path_;
};

}  // namespace

StatusOr<MergedDatabase> MergeDatabases(
    const MergeDatabasesOptions& options,
    const std::vector<DatabaseToMerge>& inputs,
    const std::string& output_path) {
  if (inputs.empty()) return Status::Error("there are no databases to merge");
  std::vector<std::pair<std::string, std::string>> named;
  for (const DatabaseToMerge& input : inputs) {
    const Status checked = CheckDatabase(input.path);
    if (!checked.ok()) return checked;
    named.emplace_back("an input", input.path);
  }
  Status status = CheckOutputIsNoInput(output_path, named);
  if (status.ok()) status = CheckOutputFile(output_path);
  if (!status.ok()) return status;
  // Two runs would use the same temporary file.
  const fs::path folder = fs::path(output_path).parent_path();
  const auto lock =
      FolderLock::Acquire(folder.empty() ? "." : folder.string(),
                          FolderLock::Mode::kExclusive, kMergerLockName);
  if (!lock.ok()) return lock.status();
  const bool is_new = !fs::exists(output_path);
  if (!is_new) status = CheckDatabase(output_path);
  if (!status.ok()) return status;
  try {
    if (!is_new) return Merge(options, inputs, output_path, is_new);
    TemporaryDatabase temporary(output_path);
    const MergedDatabase merged =
        Merge(options, inputs, temporary.Path(), is_new);
    temporary.Finish();
    return merged;
  } catch (const std::exception& error) {
    return Status::Error("cannot merge into " + output_path + ": " +
                         error.what() +
                         (is_new ? "" : "; the database is as it was"));
  }
}

}  // namespace adasfm
