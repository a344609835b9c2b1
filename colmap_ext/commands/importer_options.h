// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/commands/command.h"
#include "colmap_ext/priors/prior_importer.h"

namespace adasfm {

// The prior importer's options as --AdaSfmPriors.*, --AdaSfmTrajectory.*,
// --AdaSfmRig.* and --AdaSfmGnss.*.
void AddImporterOptions(PriorImportOptions* options, CommandOptions* command);

}  // namespace adasfm
