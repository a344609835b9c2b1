// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/coarse/global_stage.h"

namespace adasfm {

// The summary.json of adasfm_global: seconds and counts of every step, each
// model with its convergence, what was removed and why.
std::string FormatGlobalReportJson(const SceneData& scene,
                                   const GlobalStageResult& result,
                                   double total_seconds);

// The same for the screen, a few lines.
std::string FormatGlobalReportText(const GlobalStageResult& result,
                                   double total_seconds);

// One line per removed pair: `name1 name2`, a tab, and why (EdgeRemovalName, or
// that too few of its matches fit the poses).
std::string FormatRemovedPairs(const SceneData& scene,
                               const GlobalStageResult& result);

}  // namespace adasfm
