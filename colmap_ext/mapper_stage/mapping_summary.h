// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/verdict.h"

namespace adasfm {

// What is said about one of the models of a run.
struct ModelSummary {
  // Of the coarse model that it was made from, in adasfm_global's folder.
  int coarse_index = 0;
  MapperStageSummary stage;
  // Of this model by itself.
  Verdict verdict;
};

// The figures of one model, and the lines for the screen.
nlohmann::json MapperSummaryToJson(const MapperStageSummary& summary);
std::string FormatMapperSummaryText(const MapperStageSummary& summary);

// The run's summary.json (docs/reference/formats.md): the first model's
// figures, the parts of all, a short entry for each model, the images of none,
// and the verdict on all together.
std::string FormatMappingJson(const std::vector<ModelSummary>& models,
                              const Verdict& verdict);

// The lines for the screen.
std::string FormatMappingText(const std::vector<ModelSummary>& models);

}  // namespace adasfm
