// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/prior_tables.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "colmap_ext/host/database.h"

namespace adasfm {
namespace {

constexpr int kSchemaVersion = 1;
constexpr uint32_t kAllFlags =
    kPriorRotation | kPriorDirection | kPriorLength | kPriorWheelSlip;

// Doubles as a little-endian blob, whatever the machine.
std::string BlobFromDoubles(const double* values, size_t size) {
  std::string blob;
  blob.reserve(size * sizeof(double));
  for (size_t i = 0; i < size; ++i) {
    uint64_t bits;
    std::memcpy(&bits, &values[i], sizeof(bits));
    for (int byte = 0; byte < 8; ++byte) {
      blob.push_back(static_cast<char>((bits >> (8 * byte)) & 0xff));
    }
  }
  return blob;
}

void DoublesFromBlob(const SqliteStatement& statement, int column,
                     const std::string& row, size_t size, double* values) {
  if (statement.NumBytes(column) != size * sizeof(double)) {
    throw SqliteError(
        row + ": a blob of " + std::to_string(statement.NumBytes(column)) +
        " bytes instead of " + std::to_string(size * sizeof(double)));
  }
  const auto* bytes = static_cast<const unsigned char*>(statement.Blob(column));
  for (size_t i = 0; i < size; ++i) {
    uint64_t bits = 0;
    for (int byte = 0; byte < 8; ++byte) {
      bits |= static_cast<uint64_t>(bytes[8 * i + byte]) << (8 * byte);
    }
    std::memcpy(&values[i], &bits, sizeof(bits));
  }
}

void BindDoubles(SqliteStatement* statement, int parameter,
                 const double* values, size_t size) {
  const std::string blob = BlobFromDoubles(values, size);
  statement->BindBlob(parameter, blob.data(), blob.size());
}

void CreateTables(SqliteConnection* database) {
  CreateMetaTable(database);
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_image_times ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "timestamp_ns INTEGER NOT NULL);"
      "CREATE TABLE IF NOT EXISTS adasfm_relative_pose_priors ("
      "image_id1 INTEGER NOT NULL, image_id2 INTEGER NOT NULL, "
      "name1 TEXT NOT NULL, name2 TEXT NOT NULL, dt_ns INTEGER NOT NULL, "
      "qvec BLOB NOT NULL, tvec BLOB NOT NULL, covariance BLOB NOT NULL, "
      "flags INTEGER NOT NULL, PRIMARY KEY (image_id1, image_id2));"
      "CREATE TABLE IF NOT EXISTS adasfm_gravity ("
      "image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, "
      "gravity_in_cam BLOB NOT NULL);");
}

using Names = std::map<image_t, std::string>;

const std::string& NameOf(const Names& names, image_t image_id) {
  const auto name = names.find(image_id);
  if (name != names.end()) return name->second;
  throw SqliteError("no image with the id " + std::to_string(image_id));
}

void WriteImageTimes(const Names& names, const std::vector<ImageTimeRow>& rows,
                     SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_image_times VALUES (?, ?, ?)");
  for (const ImageTimeRow& row : rows) {
    statement.Reset();
    statement.BindInt(1, row.image_id);
    statement.BindText(2, NameOf(names, row.image_id));
    statement.BindInt(3, row.timestamp_ns);
    statement.Step();
  }
}

void WritePriors(const Names& names, const std::vector<RelativePosePrior>& rows,
                 SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_relative_pose_priors VALUES "
                            "(?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const RelativePosePrior& row : rows) {
    const Eigen::Quaterniond& q = row.cam2_from_cam1.rotation;
    const Eigen::Vector4d qvec(q.w(), q.x(), q.y(), q.z());
    statement.Reset();
    statement.BindInt(1, row.image_id1);
    statement.BindInt(2, row.image_id2);
    statement.BindText(3, NameOf(names, row.image_id1));
    statement.BindText(4, NameOf(names, row.image_id2));
    statement.BindInt(5, row.dt_ns);
    BindDoubles(&statement, 6, qvec.data(), 4);
    BindDoubles(&statement, 7, row.cam2_from_cam1.translation.data(), 3);
    // Symmetric, so rows or columns first is the same.
    BindDoubles(&statement, 8, row.covariance.data(), 36);
    statement.BindInt(9, row.flags);
    statement.Step();
  }
}

void WriteGravity(const Names& names, const std::vector<GravityRow>& rows,
                  SqliteConnection* database) {
  SqliteStatement statement(database,
                            "INSERT INTO adasfm_gravity VALUES (?, ?, ?)");
  for (const GravityRow& row : rows) {
    statement.Reset();
    statement.BindInt(1, row.image_id);
    statement.BindText(2, NameOf(names, row.image_id));
    BindDoubles(&statement, 3, row.gravity_in_cam.data(), 3);
    statement.Step();
  }
}

// The present id of the image that had this id and name; none when it is gone.
class IdResolver {
 public:
  explicit IdResolver(SqliteConnection* database) {
    for (const DatabaseImage& image : ReadImages(database)) {
      ids_[image.name] = image.image_id;
    }
  }

  std::optional<image_t> Resolve(const std::string& name) const {
    const auto id = ids_.find(name);
    if (id == ids_.end()) return std::nullopt;
    return id->second;
  }

 private:
  std::map<std::string, image_t> ids_;
};

void ReadImageTimes(const IdResolver& ids, SqliteConnection* database,
                    LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_image_times")) return;
  SqliteStatement statement(database,
                            "SELECT name, timestamp_ns FROM adasfm_image_times "
                            "ORDER BY timestamp_ns, name");
  while (statement.Step()) {
    const std::optional<image_t> image_id = ids.Resolve(statement.Text(0));
    if (image_id.has_value()) {
      loaded->tables.image_times.push_back({*image_id, statement.Int(1)});
    } else {
      ++loaded->num_ignored_rows;
    }
  }
}

RelativePosePrior PriorFromRow(const SqliteStatement& statement) {
  const std::string row = "table adasfm_relative_pose_priors, images " +
                          statement.Text(0) + " and " + statement.Text(1);
  RelativePosePrior prior;
  Eigen::Vector4d qvec;
  Eigen::Vector3d tvec;
  prior.dt_ns = statement.Int(2);
  DoublesFromBlob(statement, 3, row, 4, qvec.data());
  DoublesFromBlob(statement, 4, row, 3, tvec.data());
  DoublesFromBlob(statement, 5, row, 36, prior.covariance.data());
  const int64_t flags = statement.Int(6);
  // Variances may be infinite, and what is not observed may be anything finite.
  if (!tvec.allFinite() || !(std::abs(qvec.norm() - 1.0) < 1e-6) ||
      prior.covariance.hasNaN() ||
      !(prior.covariance.diagonal().array() >= 0.0).all() || prior.dt_ns < 0 ||
      (flags & ~static_cast<int64_t>(kAllFlags)) != 0) {
    throw SqliteError(row + ": values that are not a pose prior");
  }
  prior.cam2_from_cam1 =
      Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
  prior.flags = static_cast<uint32_t>(flags);
  return prior;
}

void ReadPriors(const IdResolver& ids, SqliteConnection* database,
                LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_relative_pose_priors")) return;
  std::map<image_t, timestamp_t> times;
  for (const ImageTimeRow& row : loaded->tables.image_times) {
    times[row.image_id] = row.timestamp_ns;
  }
  SqliteStatement statement(
      database,
      "SELECT name1, name2, dt_ns, qvec, tvec, covariance, flags "
      "FROM adasfm_relative_pose_priors ORDER BY image_id1, image_id2");
  while (statement.Step()) {
    const std::optional<image_t> id1 = ids.Resolve(statement.Text(0));
    const std::optional<image_t> id2 = ids.Resolve(statement.Text(1));
    if (!id1.has_value() || !id2.has_value()) {
      ++loaded->num_ignored_rows;
      continue;
    }
    RelativePosePrior prior = PriorFromRow(statement);
    prior.image_id1 = *id1;
    prior.image_id2 = *id2;
    if (times.count(*id1) == 0 || times.count(*id2) == 0) {
      throw SqliteError("table adasfm_relative_pose_priors: image " +
                        statement.Text(times.count(*id1) == 0 ? 0 : 1) +
                        " has no time");
    }
    loaded->tables.priors.push_back(prior);
  }
  std::stable_sort(
      loaded->tables.priors.begin(), loaded->tables.priors.end(),
      [&times](const RelativePosePrior& a, const RelativePosePrior& b) {
        return std::make_pair(times.at(a.image_id1), times.at(a.image_id2)) <
               std::make_pair(times.at(b.image_id1), times.at(b.image_id2));
      });
}

void ReadGravity(const IdResolver& ids, SqliteConnection* database,
                 LoadedPriorTables* loaded) {
  if (!database->HasTable("adasfm_gravity")) return;
  SqliteStatement statement(
      database,
      "SELECT name, gravity_in_cam FROM adasfm_gravity ORDER BY name");
  while (statement.Step()) {
    const std::string name = statement.Text(0);
    const std::string row = "table adasfm_gravity, image " + name;
    const std::optional<image_t> image_id = ids.Resolve(name);
    if (!image_id.has_value()) {
      ++loaded->num_ignored_rows;
      continue;
    }
    GravityRow gravity;
    gravity.image_id = *image_id;
    DoublesFromBlob(statement, 1, row, 3, gravity.gravity_in_cam.data());
    if (!(std::abs(gravity.gravity_in_cam.norm() - 1.0) < 1e-6)) {
      throw SqliteError(row + ": not a unit vector");
    }
    loaded->tables.gravity.push_back(gravity);
  }
}

}  // namespace

void CreateMetaTable(SqliteConnection* database) {
  database->Execute(
      "CREATE TABLE IF NOT EXISTS adasfm_meta ("
      "key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL);"
      "INSERT OR IGNORE INTO adasfm_meta VALUES ('schema_version', '" +
      std::to_string(kSchemaVersion) + "');");
  CheckMetaTable(database);
}

void CheckMetaTable(SqliteConnection* database) {
  if (!database->HasTable("adasfm_meta")) return;
  SqliteStatement statement(
      database, "SELECT value FROM adasfm_meta WHERE key = 'schema_version'");
  const std::string version = statement.Step() ? statement.Text(0) : "none";
  if (version == std::to_string(kSchemaVersion)) return;
  throw SqliteError("the adasfm_ tables have schema version " + version +
                    ", this program knows " + std::to_string(kSchemaVersion));
}

Status WritePriorTables(const std::string& database_path,
                        const PriorTables& tables) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    SqliteTransaction transaction(&database);
    Names names;
    for (DatabaseImage& image : ReadImages(&database)) {
      names[image.image_id] = std::move(image.name);
    }
    CreateTables(&database);
    database.Execute(
        "DELETE FROM adasfm_image_times;"
        "DELETE FROM adasfm_relative_pose_priors;"
        "DELETE FROM adasfm_gravity;");
    WriteImageTimes(names, tables.image_times, &database);
    WritePriors(names, tables.priors, &database);
    WriteGravity(names, tables.gravity, &database);
    transaction.Commit();
  } catch (const SqliteError& error) {
    return Status::Error("cannot write the priors to " + database_path + ": " +
                         error.what() + "; the database is as it was");
  }
  return Status::Ok();
}

StatusOr<LoadedPriorTables> ReadPriorTables(const std::string& database_path) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    return ReadPriorTables(&database);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what() +
                         "; run adasfm_prior_importer again");
  }
}

LoadedPriorTables ReadPriorTables(SqliteConnection* database) {
  CheckMetaTable(database);
  const IdResolver ids(database);
  LoadedPriorTables loaded;
  ReadImageTimes(ids, database, &loaded);
  ReadPriors(ids, database, &loaded);
  ReadGravity(ids, database, &loaded);
  return loaded;
}

}  // namespace adasfm
