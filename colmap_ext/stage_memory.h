// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "colmap_ext/priors/prior_importer.h"
#include "core/status.h"

namespace adasfm {

// The memory that each of the three stages takes at most, estimated before its
// work from what it is given, and compared with a budget.

// Sizes of a database.
struct SceneSize {
  int64_t num_images = 0;  // with keypoints
  int64_t num_keypoints = 0;
  int64_t num_matches = 0;  // verified
};

StatusOr<SceneSize> MeasureScene(const std::string& database_path);

// Of reading and smoothing the logs. Bags are not counted: nothing says before
// they are read how much of them are logs.
double EstimateImportMemoryBytes(const PriorImportPaths& paths);
// Of adasfm_global, and of adasfm_mapper beside the parts that it makes.
double EstimateStageMemoryBytes(const SceneSize& size);

// An error where `bytes` are more than a positive max_memory_gb (1e9 bytes).
// Without a budget (-1) a warning where they are more than is available.
// `option`: the budget's name.
Status CheckMemory(double bytes, double max_memory_gb,
                   const std::string& option,
                   std::vector<std::string>* warnings);

}  // namespace adasfm
