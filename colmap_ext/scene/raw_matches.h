// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// The matches before verification, for those of the requested pairs that have
// any. All raw matches together can be larger than the rest of a scene, so the
// source is asked for some pairs at a time. May throw SqliteError.
using RawMatches = std::map<ImagePair, std::vector<FeatureMatch>>;
using RawMatchSource = std::function<RawMatches(const std::vector<ImagePair>&)>;

// Number of pairs whose matches may be in memory together.
inline constexpr size_t kNumPairsAtATime = 1000;

// Throws SqliteError for matches that refer to keypoints that the images of
// their pair do not have.
void CheckIndices(const SceneData& scene, const ImagePair& pair,
                  const std::vector<FeatureMatch>& matches);

// From the scene, which must outlive the source.
RawMatchSource RawMatchesOfScene(const SceneData& scene);

// From the database that the scene was read from without raw matches; the scene
// must outlive the source. The matches of all pairs of the scene are read once
// and checked, so that damage is found before any work: an error for matches of
// keypoints that do not exist.
StatusOr<RawMatchSource> OpenRawMatches(const std::string& database_path,
                                        const SceneData& scene);

}  // namespace adasfm
