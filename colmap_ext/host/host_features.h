// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/features.h"
#include "core/sqlite.h"

namespace adasfm {

// Extracts features and matches them by the user's own COLMAP program instead
// of the linked library's classes: ExtractFeatures and MatchPairs (features.h)
// do so when the environment variable ADASFM_HOST_COLMAP names it. A newer
// COLMAP converts the database to its own form. Finished work is skipped.

// Whether the environment names a program.
bool UsesHostProgram();

// For a database that a newer COLMAP has converted since the images were
// registered: counts its images and cameras, and lists those of `names` that
// are no images.
StatusOr<ImageRegistration> ReadRegistration(
    const std::vector<std::string>& names, const std::string& database_path);

// Extracts the features of the images without any.
Status ExtractFeaturesByHost(const FeatureOptions& options,
                             const std::string& image_path,
                             const std::string& database_path,
                             const std::string& log_path,
                             const ProgressCallback& progress);

Status MatchPairsByHost(const FeatureOptions& options,
                        const std::vector<ImagePair>& pairs,
                        const std::string& database_path,
                        const std::string& log_path,
                        const ProgressCallback& progress);

}  // namespace adasfm
