// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/commands/command.h"

namespace adasfm {

// The coarse global stage's options as --AdaSfmGlobal.*, for every command that
// runs it.
void AddGlobalOptions(GlobalStageOptions* stage, CommandOptions* command);

}  // namespace adasfm
