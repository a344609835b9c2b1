// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Remove results of steps of the automatic reconstruction for other inputs.

// The workspace's database, and all results made from it.
Status ResetFeatures(const std::string& workspace_path);
// Matches and two-view geometries, with the backups and corrections of
// adasfm_global.
Status ResetMatches(const std::string& database_path);
// Tables of adasfm_prior_importer with the corrections of adasfm_global, and
// the importer's summary.
Status ResetPriors(const std::string& database_path);

}  // namespace adasfm
