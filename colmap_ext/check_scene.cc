// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/check_scene.h"

#include <algorithm>

#include "colmap_ext/host/database.h"
#include "core/sqlite.h"

namespace adasfm {

Status CheckHasMatches(const std::string& database_path,
                       const SceneData& scene) {
  const bool has_matches = std::any_of(
      scene.pairs.begin(), scene.pairs.end(),
      [](const auto& pair) { return !pair.inlier_matches.empty(); });
  if (has_matches) return Status::Ok();
  int num_matched = 0;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    CountMatches(&database, "matches", 1,
                 [&num_matched](const ImagePair&, int64_t) { ++num_matched; });
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return Status::Error(
      num_matched == 0
          ? "no images of " + database_path +
                " are matched; run a matcher of COLMAP first, such as "
                "sequential_matcher or exhaustive_matcher"
          : std::to_string(num_matched) + " pairs of " + database_path +
                " have matches, but no pair has enough verified ones; match "
                "more images, or check the camera's parameters");
}

}  // namespace adasfm
