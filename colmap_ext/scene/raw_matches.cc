// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/raw_matches.h"

#include <algorithm>
#include <set>
#include <utility>

#include "colmap_ext/host/database.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

// In a scene, keypoints that are not numbers are replaced by zeros; no detector
// finds keypoints there.
bool IsInScene(const SceneImage& image, point2D_t index) {
  return !image.keypoints[index].isZero(0.0);
}

RawMatches ReadPairs(const std::string& database_path, const SceneData& scene,
                     const std::vector<ImagePair>& pairs) {
  RawMatches raw_matches;
  SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
  for (const ImagePair& pair : pairs) {
    const SceneImage& image1 = scene.images.at(pair.image_id1);
    const SceneImage& image2 = scene.images.at(pair.image_id2);
    std::vector<FeatureMatch> matches =
        ReadMatchesOfPair(&database, "matches", pair);
    CheckIndices(scene, pair, matches);
    matches.erase(
        std::remove_if(matches.begin(), matches.end(),
                       [&](const FeatureMatch& match) {
                         return !IsInScene(image1, match.point2D_idx1) ||
                                !IsInScene(image2, match.point2D_idx2);
                       }),
        matches.end());
    if (!matches.empty()) raw_matches.emplace(pair, std::move(matches));
  }
  return raw_matches;
}

}  // namespace

void CheckIndices(const SceneData& scene, const ImagePair& pair,
                  const std::vector<FeatureMatch>& matches) {
  const SceneImage& image1 = scene.images.at(pair.image_id1);
  const SceneImage& image2 = scene.images.at(pair.image_id2);
  for (const FeatureMatch& match : matches) {
    if (match.point2D_idx1 < image1.keypoints.size() &&
        match.point2D_idx2 < image2.keypoints.size()) {
      continue;
    }
    throw SqliteError("the matches of " + image1.name + " and " + image2.name +
                      " name keypoints that these images do not have");
  }
}

RawMatchSource RawMatchesOfScene(const SceneData& scene) {
  return [&scene](const std::vector<ImagePair>& pairs) {
    const std::set<ImagePair> wanted(pairs.begin(), pairs.end());
    RawMatches raw_matches;
    for (const ScenePair& pair : scene.pairs) {
      const ImagePair ids(pair.image_id1, pair.image_id2);
      if (pair.raw_matches.empty() || wanted.count(ids) == 0) continue;
      raw_matches.emplace(ids, pair.raw_matches);
    }
    return raw_matches;
  };
}

StatusOr<RawMatchSource> OpenRawMatches(const std::string& database_path,
                                        const SceneData& scene) {
  RawMatchSource source = [database_path,
                           &scene](const std::vector<ImagePair>& pairs) {
    return ReadPairs(database_path, scene, pairs);
  };
  try {
    std::vector<ImagePair> block;
    for (const ScenePair& pair : scene.pairs) {
      block.emplace_back(pair.image_id1, pair.image_id2);
      if (block.size() < kNumPairsAtATime) continue;
      source(block);
      block.clear();
    }
    source(block);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what() +
                         "; the database is damaged or out of step with "
                         "itself, extract and match again");
  }
  return source;
}

}  // namespace adasfm
