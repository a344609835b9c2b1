// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

// Upper estimate, in bytes, of the memory that a part needs beside the scene:
// matches in the correspondence graph, tracks, and the adjustment's
// observations and equations. Made from the numbers of keypoints and matches.
double EstimatePartMemoryBytes(const SceneData& data,
                               const std::vector<image_t>& part);

// The memory that is available without swapping and within the limits (of the
// control group as it stands below /sys/fs/cgroup, and of the address space).
double AvailableMemoryBytes();

// The memory that the limit of that folder's control group leaves, with the
// file cache counted as free; infinite without a limit.
double MemoryLeftInGroup(const std::string& folder);

// How many of the parts may run at the same time so that the biggest ones fit
// into `memory_bytes` together; at least one.
int CountPartsThatFit(const std::vector<double>& part_memory_bytes,
                      double memory_bytes);

}  // namespace adasfm
