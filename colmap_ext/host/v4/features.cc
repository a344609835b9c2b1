// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/features.h"

#include "colmap_ext/host/host_features.h"

namespace adasfm {

// The host's program always extracts and matches: it has the version of the
// linked library, and that version's options.

bool UsesGpu(const FeatureOptions& options) { return options.use_gpu == 1; }

Status CheckGpu(const FeatureOptions&) { return Status::Ok(); }

Status ExtractFeatures(const FeatureOptions& options,
                       const std::string& image_path,
                       const std::string& database_path,
                       const std::string& log_path,
                       const ProgressCallback& progress) {
  return ExtractFeaturesByHost(options, image_path, database_path, log_path,
                               progress);
}

Status MatchPairs(const FeatureOptions& options,
                  const std::vector<ImagePair>& pairs,
                  const std::string& database_path, const std::string& log_path,
                  const ProgressCallback& progress, const MotionPredictor&,
                  int* num_guided) {
  if (num_guided != nullptr) *num_guided = 0;
  return MatchPairsByHost(options, pairs, database_path, log_path, progress);
}

}  // namespace adasfm
