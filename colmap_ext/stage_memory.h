// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "colmap_ext/priors/prior_importer.h"
#include "core/status.h"

namespace adasfm {

// Upper estimates of the memory of each stage, made from the sizes of its
// inputs before its work, and their comparison with a budget.

// Sizes of a database.
struct SceneSize {
  int64_t num_images = 0;  // with keypoints
  int64_t num_keypoints = 0;
  int64_t num_matches = 0;  // verified
};

StatusOr<SceneSize> MeasureScene(const std::string& database_path);

// For reading and smoothing the logs. Bags are not counted, as the share of
// logs in a bag is unknown before it is read.
double EstimateImportMemoryBytes(const PriorImportPaths& paths);
// For adasfm_global, and for adasfm_mapper without the parts that it makes.
double EstimateStageMemoryBytes(const SceneSize& size);

// An error where `bytes` exceed a positive max_memory_gb (1e9 bytes). Without a
// budget (-1) a warning where they exceed the available memory. `option`: the
// budget's name.
Status CheckMemory(double bytes, double max_memory_gb,
                   const std::string& option,
                   std::vector<std::string>* warnings);

}  // namespace adasfm
