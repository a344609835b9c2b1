// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/features/sift_features.h"
#include "core/progress.h"
#include "core/status.h"

namespace adasfm {

// Writes the SIFT features of all images of the database that have none yet, so
// that an interrupted call continues; a few images are in memory at a time. An
// interruption by `progress` leaves the database consistent. image_path: the
// folder that image names are relative to. num_threads: -1 for all. The error
// names an image that OpenCV cannot read, or the database's fault. Throws
// std::invalid_argument for invalid options.
Status ExtractSiftOfDatabase(const SiftFeatureOptions& options, int num_threads,
                             const std::string& image_path,
                             const std::string& database_path,
                             const ProgressCallback& progress);

}  // namespace adasfm
