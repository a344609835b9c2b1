// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/early_database.h"

#include <array>
#include <filesystem>
#include <fstream>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// One row: the inputs that the matches depend on.
constexpr const char* kInputsTable = "adasfm_early_inputs";
// Tables that grow during the work; all other tables are copied completely.
constexpr std::array<const char*, 2> kFeatureTables = {"keypoints",
                                                       "descriptors"};
constexpr std::array<const char*, 2> kMatchTables = {"matches",
                                                     "two_view_geometries"};

struct SchemaEntry {
  std::string type;
  std::string name;
  std::string sql;
};

void Attach(const std::string& path, SqliteConnection* database) {
  SqliteStatement attach(database, "ATTACH ? AS other");
  attach.BindText(1, path);
  attach.Step();
}

// Attaches a database that the extraction is writing to.
void AttachForReading(const std::string& path, SqliteConnection* database) {
  Attach(path, database);
  SqliteStatement mode(database, "PRAGMA other.journal_mode");
  if (!mode.Step() || mode.Text(0) != "wal") {
    throw SqliteError(path + " cannot be read while it is written");
  }
}

// Tables first.
std::vector<SchemaEntry> ReadSchema(SqliteConnection* database) {
  SqliteStatement statement(
      database,
      "SELECT type, name, sql FROM other.sqlite_master WHERE sql IS NOT NULL "
      "AND name NOT LIKE 'sqlite\\_%' ESCAPE '\\' ORDER BY type <> 'table'");
  std::vector<SchemaEntry> entries;
  while (statement.Step()) {
    entries.push_back(
        {statement.Text(0), statement.Text(1), statement.Text(2)});
  }
  return entries;
}

bool IsCopied(const SchemaEntry& entry) {
  if (entry.type != "table") return false;
  for (const auto& tables : {kFeatureTables, kMatchTables}) {
    for (const char* name : tables) {
      if (entry.name == name) return false;
    }
  }
  return true;
}

// So that the program that made the other database finds its own version here.
void CopyVersion(SqliteConnection* database) {
  int64_t version = 0;
  {
    SqliteStatement read(database, "PRAGMA other.user_version");
    if (read.Step()) version = read.Int(0);
  }
  database->Execute("PRAGMA main.user_version = " + std::to_string(version));
}

bool HasInputs(const std::string& early_path, const std::string& inputs) {
  SqliteConnection database(early_path, SqliteConnection::Mode::kWrite);
  if (!database.HasTable(kInputsTable)) return false;
  SqliteStatement statement(&database,
                            std::string("SELECT inputs FROM ") + kInputsTable);
  return statement.Step() && statement.Text(0) == inputs;
}

// The transaction ends with the connection, unless committed. Unlike
// SqliteTransaction, it does not block the extraction's writing to the attached
// database.
void BeginReadingOther(SqliteConnection* database) {
  database->Execute("BEGIN DEFERRED");
}

bool Exists(const std::string& path) {
  std::error_code none;
  return fs::exists(path, none);
}

int MoveMatches(const std::string& early_path,
                const std::string& database_path) {
  SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
  Attach(early_path, &database);
  SqliteTransaction transaction(&database);
  for (const char* table : kMatchTables) {
    // A pair with a row in only one of the tables is incomplete.
    database.Execute(
        std::string("INSERT OR IGNORE INTO main.") + table +
        " SELECT * FROM other." + table +
        " WHERE pair_id IN (SELECT pair_id FROM other.matches) AND "
        "pair_id IN (SELECT pair_id FROM other.two_view_geometries)");
  }
  int num_pairs = 0;
  {
    SqliteStatement count(&database,
                          "SELECT count(*) FROM other.two_view_geometries "
                          "WHERE pair_id IN (SELECT pair_id FROM "
                          "other.matches)");
    if (count.Step()) num_pairs = count.Int(0);
  }
  transaction.Commit();
  return num_pairs;
}

}  // namespace

void OpenEarlyDatabase(const std::string& database_path,
                       const std::string& inputs,
                       const std::string& early_path) {
  if (Exists(early_path) && HasInputs(early_path, inputs)) return;
  const Status removed = RemoveEarlyDatabase(early_path);
  if (!removed.ok()) throw SqliteError(removed.message());
  // SQLite takes an empty file for a database without tables.
  if (!std::ofstream(early_path).flush()) {
    throw SqliteError("cannot write " + early_path);
  }
  SqliteConnection database(early_path, SqliteConnection::Mode::kWrite);
  AttachForReading(database_path, &database);
  BeginReadingOther(&database);
  CopyVersion(&database);
  const std::vector<SchemaEntry> entries = ReadSchema(&database);
  for (const SchemaEntry& entry : entries) {
    database.Execute(entry.sql);
    if (!IsCopied(entry)) continue;
    database.Execute("INSERT INTO main.\"" + entry.name +
                     "\" SELECT * FROM other.\"" + entry.name + "\"");
  }
  database.Execute(std::string("CREATE TABLE ") + kInputsTable +
                   "(inputs TEXT NOT NULL)");
  {
    SqliteStatement insert(
        &database, std::string("INSERT INTO ") + kInputsTable + " VALUES(?)");
    insert.BindText(1, inputs);
    insert.Step();
  }
  database.Execute("COMMIT");
}

EarlyFeatures::EarlyFeatures(const std::string& early_path,
                             const std::string& database_path)
    : early_(early_path, SqliteConnection::Mode::kWrite) {
  AttachForReading(database_path, &early_);
}

std::set<image_t> EarlyFeatures::FindReady() {
  SqliteStatement statement(
      &early_,
      "SELECT image_id FROM other.images WHERE "
      "image_id IN (SELECT image_id FROM other.keypoints) AND "
      "image_id IN (SELECT image_id FROM other.descriptors)");
  std::set<image_t> ready;
  while (statement.Step()) ready.insert(statement.Int(0));
  return ready;
}

void EarlyFeatures::Hold(const std::set<image_t>& image_ids) {
  BeginReadingOther(&early_);
  for (const char* table : kFeatureTables) {
    std::vector<image_t> outdated;
    {
      SqliteStatement statement(
          &early_, std::string("SELECT image_id FROM main.") + table);
      while (statement.Step()) {
        const image_t image_id = statement.Int(0);
        if (image_ids.count(image_id) == 0) outdated.push_back(image_id);
      }
    }
    SqliteStatement remove(&early_, std::string("DELETE FROM main.") + table +
                                        " WHERE image_id = ?");
    for (const image_t image_id : outdated) {
      remove.Reset();
      remove.BindInt(1, image_id);
      remove.Step();
    }
    SqliteStatement copy(&early_, std::string("INSERT OR IGNORE INTO main.") +
                                      table + " SELECT * FROM other." + table +
                                      " WHERE image_id = ?");
    for (const image_t image_id : image_ids) {
      copy.Reset();
      copy.BindInt(1, image_id);
      copy.Step();
    }
  }
  early_.Execute("COMMIT");
}

StatusOr<int> TakeEarlyMatches(const std::string& early_path,
                               const std::string& inputs,
                               const std::string& database_path) {
  if (!Exists(early_path)) return 0;
  int num_pairs = 0;
  try {
    if (HasInputs(early_path, inputs)) {
      num_pairs = MoveMatches(early_path, database_path);
    }
  } catch (const SqliteError&) {
    // For example another COLMAP's form: these pairs are matched again.
  }
  const Status removed = RemoveEarlyDatabase(early_path);
  if (!removed.ok()) return removed;
  return num_pairs;
}

Status RemoveEarlyDatabase(const std::string& early_path) {
  for (const char* suffix : {"", "-wal", "-shm", "-journal", ".priors.json"}) {
    std::error_code error;
    fs::remove(early_path + suffix, error);
    if (error) {
      return Status::Error("cannot remove " + early_path + suffix + ": " +
                           error.message());
    }
  }
  return Status::Ok();
}

}  // namespace adasfm
