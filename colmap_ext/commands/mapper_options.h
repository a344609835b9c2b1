// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/commands/command.h"

namespace adasfm {

// The mapper's options as --AdaSfmMapper.*, --AdaSfmPartition.* and
// --AdaSfmAlign.*.
void AddMapperOptions(MapOptions* options, CommandOptions* command);

}  // namespace adasfm
