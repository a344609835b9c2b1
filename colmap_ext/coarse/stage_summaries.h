// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/two_view_poses.h"

namespace adasfm {

// What the lines of the global stage's steps say.
std::string DescribeViewGraph(const InitialViewGraph& initial);
// Reported before the memory is used.
std::string DescribeTrackMemory(const CoarseModelInput& input);
std::string DescribeModel(const CoarseModel& model);
std::string DescribeMatches(const GlobalStageResult& result);
std::string DescribeSizes(const GlobalStageResult& result);

}  // namespace adasfm
