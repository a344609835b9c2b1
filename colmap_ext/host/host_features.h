// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/features.h"
#include "core/sqlite.h"

namespace adasfm {

// Features and matches by the program of the user's own COLMAP instead of the
// linked library's classes: what ExtractFeatures and MatchPairs (features.h) do
// when the environment variable ADASFM_HOST_COLMAP names it. A newer COLMAP
// turns the database into its own form; what it finds done, it leaves out.

// Whether the environment names a program.
bool UsesHostProgram();

// Of a database that a newer COLMAP has converted since the images were
// registered: its images and cameras, and those of `names` that are no images.
StatusOr<ImageRegistration> ReadRegistration(
    const std::vector<std::string>& names, const std::string& database_path);

// Their names, in order: images without keypoints or descriptors. Throws
// SqliteError.
std::vector<std::string> ImagesWithoutFeatures(SqliteConnection* database);

// Of those images.
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
