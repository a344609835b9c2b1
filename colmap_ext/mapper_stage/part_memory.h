// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/scene/scene_data.h"
#include "core/types.h"

namespace adasfm {

// What a part at work needs beside the scene: matches in the correspondence
// graph, tracks, and the adjustment's observations and equations. An upper
// estimate in bytes from its keypoints and matches.
double EstimatePartMemoryBytes(const SceneData& data,
                               const std::vector<image_t>& part);

// What the system can give without swapping, and limits (those of the control
// group as it stands below /sys/fs/cgroup, and of the address space) allow.
double AvailableMemoryBytes();

// What the limit of the control group of that folder leaves, without the cache
// of files; infinite without a limit.
double MemoryLeftInGroup(const std::string& folder);

// How many of the parts may run at the same time so that the biggest ones fit
// into `memory_bytes` together; at least one.
int CountPartsThatFit(const std::vector<double>& part_memory_bytes,
                      double memory_bytes);

}  // namespace adasfm
