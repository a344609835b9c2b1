// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Removing what steps of the automatic reconstruction left under other inputs.

// The workspace's database, and all that was made from it.
Status ResetFeatures(const std::string& workspace_path);
// Matches and two-view geometries, with what adasfm_global kept of them.
Status ResetMatches(const std::string& database_path);
// The tables that adasfm_prior_importer made and adasfm_global corrected, and
// the importer's summary.
Status ResetPriors(const std::string& database_path);

}  // namespace adasfm
