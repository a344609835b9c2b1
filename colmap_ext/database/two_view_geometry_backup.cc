// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/two_view_geometry_backup.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/database_schema.h"
#include "core/hash.h"

namespace adasfm {
namespace {

// The table has all columns of two_view_geometries, including those of newer
// COLMAPs. written_digest is the digest of the row that replaced this one; NULL
// when none did.
void CreateTable(SqliteConnection* database) {
  CreateMetaTable(database);
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_two_view_geometries ("
      "pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, "
      "cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, "
      "E BLOB, H BLOB, qvec BLOB, tvec BLOB, name1 TEXT NOT NULL, "
      "name2 TEXT NOT NULL, written_digest INTEGER)");
  for (const std::string& column : database->Columns("two_view_geometries")) {
    if (HasColumn(database, kTwoViewGeometryBackupTable, column)) continue;
    database->Execute("ALTER TABLE adasfm_two_view_geometries ADD COLUMN \"" +
                      column + "\" BLOB");
  }
}

// The columns that both tables have, as a list for a statement.
std::string CommonColumns(SqliteConnection* database) {
  std::string list;
  for (const std::string& column : database->Columns("two_view_geometries")) {
    if (!HasColumn(database, kTwoViewGeometryBackupTable, column)) continue;
    list += (list.empty() ? "\"" : ", \"") + column + "\"";
  }
  return list;
}

// Digests of the present two_view_geometries. A missing matrix or pose is
// digested as zeros, since COLMAP 4 replaces the zeros of an older file by NULL
// when it opens the file.
class RowDigester {
 public:
  explicit RowDigester(SqliteConnection* database)
      : statement_(database,
                   "SELECT pair_id, rows, cols, data, config, F, E, H, qvec, "
                   "tvec FROM two_view_geometries WHERE pair_id = ?") {}

  // None when there is no row.
  std::optional<int64_t> Compute(int64_t pair_id) {
    static constexpr std::pair<int, int64_t> kBlobs[] = {
        {3, 0}, {5, 72}, {6, 72}, {7, 72}, {8, 32}, {9, 24}};
    statement_.Reset();
    statement_.BindInt(1, pair_id);
    if (!statement_.Step()) return std::nullopt;
    Fnv1aHash digest;
    for (const int column : {1, 2, 4}) {
      const int64_t value = statement_.Int(column);
      digest.AddBytes(&value, sizeof(value));
    }
    for (const auto& [column, full_num_bytes] : kBlobs) {
      const int64_t num_bytes = statement_.NumBytes(column);
      if (num_bytes > 0) {
        digest.AddBytes(&num_bytes, sizeof(num_bytes));
        digest.AddBytes(statement_.Blob(column), num_bytes);
      } else {
        const std::string zeros(full_num_bytes, '\0');
        digest.AddBytes(&full_num_bytes, sizeof(full_num_bytes));
        digest.AddBytes(zeros.data(), zeros.size());
      }
    }
    return static_cast<int64_t>(digest.Value());
  }

 private:
  SqliteStatement statement_;
};

struct KeptRow {
  int64_t pair_id = 0;
  std::optional<int64_t> written_digest;
  std::string name1;
  std::string name2;
};

std::map<image_t, std::string> ReadNames(SqliteConnection* database) {
  std::map<image_t, std::string> names;
  for (DatabaseImage& image : ReadImages(database)) {
    names[image.image_id] = std::move(image.name);
  }
  return names;
}

// Returns the valid kept rows, and the number of the others.
std::vector<int64_t> FindCurrentRows(SqliteConnection* database,
                                     int* num_outdated) {
  *num_outdated = 0;
  std::vector<int64_t> current;
  if (!database->HasTable(kTwoViewGeometryBackupTable)) return current;
  CheckMetaTable(database);
  std::vector<KeptRow> rows;
  SqliteStatement statement(database,
                            "SELECT pair_id, written_digest, name1, name2 "
                            "FROM adasfm_two_view_geometries ORDER BY pair_id");
  while (statement.Step()) {
    KeptRow row{statement.Int(0), std::nullopt, statement.Text(2),
                statement.Text(3)};
    if (!statement.IsNull(1)) row.written_digest = statement.Int(1);
    rows.push_back(std::move(row));
  }
  const std::map<image_t, std::string> names = ReadNames(database);
  const auto has_name = [&names](image_t image_id, const std::string& name) {
    const auto found = names.find(image_id);
    return found != names.end() && found->second == name;
  };
  RowDigester digester(database);
  for (const KeptRow& row : rows) {
    const ImagePair pair = ImagePairFromPairId(row.pair_id);
    if (has_name(pair.image_id1, row.name1) &&
        has_name(pair.image_id2, row.name2) &&
        digester.Compute(row.pair_id) == row.written_digest) {
      current.push_back(row.pair_id);
    } else {
      ++*num_outdated;
    }
  }
  return current;
}

bool AreZeros(const double* values, int num_values) {
  return std::all_of(values, values + num_values,
                     [](double value) { return value == 0.0; });
}

// The doubles of a column; zeros when the row has no such blob.
std::vector<double> ReadDoubles(const SqliteStatement& statement, int column,
                                int num_values) {
  std::vector<double> values(num_values, 0.0);
  if (statement.NumBytes(column) == num_values * sizeof(double)) {
    const auto* data = static_cast<const char*>(statement.Blob(column));
    std::copy(data, data + num_values * sizeof(double),
              reinterpret_cast<char*>(values.data()));
  }
  return values;
}

// Replaces by NULL the matrices and poses that mean "none" in a file of COLMAP
// 3 (zeros, and the identity pose), as COLMAP 4 does with such a file.
void ClearMissing(int64_t pair_id, SqliteConnection* database) {
  std::vector<std::string> cleared;
  {
    SqliteStatement statement(database,
                              "SELECT F, E, H, qvec, tvec FROM "
                              "two_view_geometries WHERE pair_id = ?");
    statement.BindInt(1, pair_id);
    if (!statement.Step()) return;
    int column = 0;
    for (const char* name : {"F", "E", "H"}) {
      const std::vector<double> matrix = ReadDoubles(statement, column++, 9);
      if (AreZeros(matrix.data(), 9)) cleared.push_back(name);
    }
    const std::vector<double> q = ReadDoubles(statement, 3, 4);
    const std::vector<double> t = ReadDoubles(statement, 4, 3);
    const bool is_identity =
        q[0] == 1.0 && AreZeros(q.data() + 1, 3) && AreZeros(t.data(), 3);
    if (AreZeros(q.data(), 4) || is_identity) {
      cleared.insert(cleared.end(), {"qvec", "tvec"});
    }
  }
  for (const std::string& column : cleared) {
    SqliteStatement statement(database, "UPDATE two_view_geometries SET " +
                                            column +
                                            " = NULL WHERE pair_id = ?");
    statement.BindInt(1, pair_id);
    statement.Step();
  }
}

RestoreSummary RestoreRows(SqliteConnection* database) {
  RestoreSummary summary;
  const std::vector<int64_t> pair_ids =
      FindCurrentRows(database, &summary.num_outdated);
  if (pair_ids.empty() && summary.num_outdated == 0) return summary;
  const std::string columns = CommonColumns(database);
  SqliteStatement restore(
      database, "INSERT OR REPLACE INTO two_view_geometries (" + columns +
                    ") SELECT " + columns +
                    " FROM adasfm_two_view_geometries WHERE pair_id = ?");
  SqliteStatement forget(
      database, "DELETE FROM adasfm_two_view_geometries WHERE pair_id = ?");
  const bool missing_is_null = StoresMissingAsNull(database);
  for (const int64_t pair_id : pair_ids) {
    for (SqliteStatement* statement : {&restore, &forget}) {
      statement->Reset();
      statement->BindInt(1, pair_id);
      statement->Step();
    }
    if (missing_is_null) ClearMissing(pair_id, database);
  }
  summary.num_restored = pair_ids.size();
  return summary;
}

void KeepRows(const std::vector<ImagePair>& pairs, SqliteConnection* database) {
  const std::map<image_t, std::string> names = ReadNames(database);
  const std::string columns = CommonColumns(database);
  SqliteStatement statement(
      database, "INSERT OR REPLACE INTO adasfm_two_view_geometries (" +
                    columns + ", name1, name2, written_digest) SELECT " +
                    columns +
                    ", ?, ?, NULL FROM two_view_geometries WHERE pair_id = ?");
  for (const ImagePair& pair : pairs) {
    const auto name1 = names.find(pair.image_id1);
    const auto name2 = names.find(pair.image_id2);
    if (name1 == names.end() || name2 == names.end()) {
      throw SqliteError("the pair of images " + std::to_string(pair.image_id1) +
                        " and " + std::to_string(pair.image_id2) +
                        " is not in the database");
    }
    statement.Reset();
    statement.BindText(1, name1->second);
    statement.BindText(2, name2->second);
    statement.BindInt(3, PairIdFromImagePair(pair));
    statement.Step();
  }
}

void RecordDigests(const std::vector<NewTwoViewGeometry>& rows,
                   SqliteConnection* database) {
  RowDigester digester(database);
  SqliteStatement statement(
      database,
      "UPDATE adasfm_two_view_geometries SET written_digest = ? "
      "WHERE pair_id = ?");
  for (const NewTwoViewGeometry& row : rows) {
    const int64_t pair_id = PairIdFromImagePair(row.pair);
    statement.Reset();
    statement.BindInt(1, digester.Compute(pair_id).value());
    statement.BindInt(2, pair_id);
    statement.Step();
  }
}

void RemoveRows(const std::vector<ImagePair>& pairs,
                SqliteConnection* database) {
  SqliteStatement statement(
      database, "DELETE FROM two_view_geometries WHERE pair_id = ?");
  for (const ImagePair& pair : pairs) {
    statement.Reset();
    statement.BindInt(1, PairIdFromImagePair(pair));
    statement.Step();
  }
}

}  // namespace

Status RewriteTwoViewGeometries(const std::string& database_path,
                                const std::vector<NewTwoViewGeometry>& rows,
                                const std::vector<ImagePair>& removed,
                                const PriorCorrections& corrections) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  std::vector<ImagePair> pairs = removed;
  for (const NewTwoViewGeometry& row : rows) pairs.push_back(row.pair);
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    AddPoseColumns(&database);
    CreateTable(&database);
    RestoreRows(&database);
    KeepRows(pairs, &database);
    RemoveRows(removed, &database);
    WriteTwoViewGeometries(&database, rows);
    RecordDigests(rows, &database);
    WritePriorCorrections(corrections, &database);
    transaction.Commit();
  } catch (const SqliteError& error) {
    return Status::Error("cannot rewrite the two-view geometries of " +
                         database_path + ": " + error.what() +
                         "; the database is as it was");
  }
  return Status::Ok();
}

StatusOr<RestoreSummary> RestoreTwoViewGeometries(
    const std::string& database_path) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  try {
    {
      SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
      if (!database.HasTable(kTwoViewGeometryBackupTable) &&
          !HasPriorCorrections(&database)) {
        return RestoreSummary();
      }
    }
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    RestoreSummary summary = RestoreRows(&database);
    if (summary.num_outdated == 0) {
      database.Execute("DROP TABLE IF EXISTS adasfm_two_view_geometries");
    }
    summary.priors_restored = HasPriorCorrections(&database);
    RemovePriorCorrections(&database);
    transaction.Commit();
    return summary;
  } catch (const SqliteError& error) {
    return Status::Error("cannot restore the two-view geometries of " +
                         database_path + ": " + error.what() +
                         "; the database is as it was");
  }
}

std::vector<ImagePair> FindKeptOriginals(SqliteConnection* database) {
  int num_outdated = 0;
  std::vector<ImagePair> pairs;
  for (const int64_t pair_id : FindCurrentRows(database, &num_outdated)) {
    pairs.push_back(ImagePairFromPairId(pair_id));
  }
  return pairs;
}

}  // namespace adasfm
