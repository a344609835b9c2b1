// SPDX-License-Identifier: BSD-3-Clause
#include <base/database.h>
#include <feature/matching.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <utility>

#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/host/host_features.h"
#include "colmap_ext/host/v3/match_sift_pairs.h"
#include "colmap_ext/io/capture_output.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// Pairs per thread that are matched in one transaction. A kill loses one
// transaction, and an interruption waits for it, a second or less.
constexpr size_t kNumPairsPerThread = 32;
constexpr size_t kNumPairsPerThreadOfHost = 8;
// Images whose features are kept in memory; the pairs of an image are adjacent.
constexpr size_t kNumCachedImages = 200;

using PairBlock = std::vector<ImagePair>;

void MatchInBlocks(const std::vector<ImagePair>& pairs, size_t block_size,
                   colmap::Database* database, const ProgressCallback& progress,
                   const std::function<void(const PairBlock&)>& match) {
  for (size_t begin = 0; begin < pairs.size(); begin += block_size) {
    const size_t end = std::min(pairs.size(), begin + block_size);
    {
      colmap::DatabaseTransaction transaction(database);
      match(PairBlock(pairs.begin() + begin, pairs.begin() + end));
    }
    progress("matched " + std::to_string(end) + " of " +
                 std::to_string(pairs.size()) + " pairs",
             static_cast<double>(end) / pairs.size());
  }
}

Status MatchByHostClasses(const FeatureOptions& options,
                          const std::vector<ImagePair>& pairs,
                          colmap::Database* database,
                          colmap::FeatureMatcherCache* cache,
                          const ProgressCallback& progress) {
  colmap::SiftMatchingOptions sift;
  sift.num_threads = options.num_threads;
  sift.use_gpu = UsesGpu(options);
  colmap::SiftFeatureMatcher matcher(sift, database, cache);
  if (!matcher.Setup()) {
    return Status::Error(
        "the host cannot match features on the GPU; use --use_gpu 0");
  }
  cache->Setup();
  MatchInBlocks(
      pairs,
      kNumPairsPerThreadOfHost * EffectiveNumThreads(options.num_threads),
      database, progress, [&matcher](const PairBlock& block) {
        std::vector<std::pair<image_t, image_t>> ids;
        for (const ImagePair& pair : block) {
          ids.emplace_back(pair.image_id1, pair.image_id2);
        }
        matcher.Match(ids);
      });
  return Status::Ok();
}

}  // namespace

Status MatchPairs(const FeatureOptions& options,
                  const std::vector<ImagePair>& pairs,
                  const std::string& database_path, const std::string& log_path,
                  const ProgressCallback& progress,
                  const MotionPredictor& predictor, int* num_guided) {
  if (num_guided != nullptr) *num_guided = 0;
  if (UsesHostProgram()) {
    return MatchPairsByHost(options, pairs, database_path, log_path, progress);
  }
  const Status opens = CheckLibraryOpens(database_path);
  if (!opens.ok()) return opens;
  const Status gpu = CheckGpu(options);
  if (!gpu.ok()) return gpu;
  const CaptureOutput capture(log_path, "");
  colmap::Database database(database_path);
  colmap::FeatureMatcherCache cache(kNumCachedImages, &database);
  if (UsesGpu(options) || options.matcher == "host") {
    return MatchByHostClasses(options, pairs, &database, &cache, progress);
  }
  cache.Setup();
  SiftPairMatcher matcher(options.num_threads, &cache, predictor);
  try {
    MatchInBlocks(pairs,
                  kNumPairsPerThread * EffectiveNumThreads(options.num_threads),
                  &database, progress,
                  [&matcher](const PairBlock& block) { matcher.Match(block); });
  } catch (const std::runtime_error& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  if (num_guided != nullptr) *num_guided = matcher.NumGuided();
  return Status::Ok();
}

}  // namespace adasfm
