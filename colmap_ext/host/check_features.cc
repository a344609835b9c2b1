// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/host/host_features.h"

namespace adasfm {

static Status MissingRows(const std::string& database_path,
                          const std::string& what, const std::string& count,
                          const std::string& log_name) {
  return Status::Error(database_path + ": " + what + " " + count +
                       "; see logs/" + log_name +
                       ", make sure that the disk has room, and run again");
}

Status CheckFeatures(const std::string& database_path) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    const std::vector<DatabaseImage> images =
        ReadImagesWithoutFeatures(&database);
    if (images.empty()) return Status::Ok();
    return MissingRows(database_path, "the features of",
                       std::to_string(images.size()) + " of " +
                           std::to_string(ReadImages(&database).size()) +
                           " images are missing (the first one is " +
                           images.front().name + ")",
                       "features.log");
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
}

Status CheckMatches(const std::string& database_path,
                    const std::vector<ImagePair>& pairs) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database,
        "SELECT 1 FROM matches JOIN two_view_geometries USING (pair_id) "
        "WHERE pair_id = ?");
    size_t num_missing = 0;
    for (const ImagePair& pair : pairs) {
      statement.Reset();
      statement.BindInt(1, PairIdFromImagePair(pair));
      if (!statement.Step()) ++num_missing;
    }
    if (num_missing == 0) return Status::Ok();
    return MissingRows(database_path, "the matches of",
                       std::to_string(num_missing) + " of " +
                           std::to_string(pairs.size()) + " pairs are missing",
                       "matching.log");
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
}

}  // namespace adasfm
