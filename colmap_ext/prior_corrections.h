// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/sqlite.h"
#include "core/relative_pose_prior.h"

namespace adasfm {

// The table adasfm_prior_corrections: the rotations that adasfm_global gave to
// priors whose gyroscope vision corrected (docs/formats.md). The priors
// themselves stay as they were imported, so that a second run starts from them;
// a new import removes the corrections. All functions throw SqliteError.

// Replaces all rows by the rotations of `priors`, whose images the database
// must have; without priors nothing of the table remains. Within the caller's
// transaction.
void WritePriorCorrections(const std::vector<RelativePosePrior>& priors,
                           SqliteConnection* database);

bool HasPriorCorrections(SqliteConnection* database);
void RemovePriorCorrections(SqliteConnection* database);

// Gives the priors their corrected rotations, where there are any. Rows are
// matched by image name.
void ApplyPriorCorrections(SqliteConnection* database,
                           std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
