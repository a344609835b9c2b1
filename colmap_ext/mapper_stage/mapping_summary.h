// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/verdict.h"

namespace adasfm {

// Summary of one of the models of a run.
struct ModelSummary {
  // Number of its coarse model in adasfm_global's folder.
  int coarse_index = 0;
  MapperStageSummary stage;
  // Verdict on this model alone.
  Verdict verdict;
};

// The figures of one model, and the lines for the screen.
nlohmann::json MapperSummaryToJson(const MapperStageSummary& summary);
std::string FormatMapperSummaryText(const MapperStageSummary& summary);

// The run's summary.json (docs/reference/formats.md): the first model's
// figures, the parts of all models, a short entry for each model, the images in
// no model, and the verdict on all models.
std::string FormatMappingJson(const std::vector<ModelSummary>& models,
                              const Verdict& verdict);

// The lines for the screen.
std::string FormatMappingText(const std::vector<ModelSummary>& models);

}  // namespace adasfm
