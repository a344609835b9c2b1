// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/commands/command.h"
#include "colmap_ext/pairs/select_pairs.h"

namespace adasfm {

// --AdaSfmPairs.*, for every command that selects pairs.
void AddPairOptions(PairSelectionOptions* options, CommandOptions* command);

}  // namespace adasfm
