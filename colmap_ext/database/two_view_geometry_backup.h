// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/host/database.h"
#include "core/sqlite.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// The table adasfm_two_view_geometries keeps replaced and removed rows, byte
// for byte (docs/reference/formats.md). A kept row is valid as long as the row
// in its place is the one that we wrote: when COLMAP has verified the pair
// again since, the present row is the original. COLMAP 4 may open the file in
// between, which converts it.

// Replaces the pairs' two-view geometries by `rows`, removes those of
// `removed`, and writes the corrections of priors, all in one transaction.
// First restores what an earlier call replaced, so that calling twice equals
// calling once. On error nothing has changed.
Status RewriteTwoViewGeometries(const std::string& database_path,
                                const std::vector<NewTwoViewGeometry>& rows,
                                const std::vector<ImagePair>& removed,
                                const PriorCorrections& corrections = {});

struct RestoreSummary {
  int num_restored = 0;
  // Rows that COLMAP has replaced since, or whose images changed.
  int num_outdated = 0;
  // Whether the priors had been corrected; they are as imported again.
  bool priors_restored = false;
};

// Restores all valid originals and drops the tables, also those of corrected
// priors, in one transaction. Invalid originals stay in their table. In a file
// of COLMAP 4's form, matrices and poses of zeros are restored as NULL, its
// value for "none". Without the tables nothing is changed.
StatusOr<RestoreSummary> RestoreTwoViewGeometries(
    const std::string& database_path);

// The pairs with a valid kept original; throws SqliteError.
std::vector<ImagePair> FindKeptOriginals(SqliteConnection* database);

inline constexpr char kTwoViewGeometryBackupTable[] =
    "adasfm_two_view_geometries";

}  // namespace adasfm
