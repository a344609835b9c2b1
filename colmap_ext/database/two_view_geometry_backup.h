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

// The table adasfm_two_view_geometries keeps the rows that were replaced or
// removed, byte for byte (docs/reference/formats.md). A kept row counts for as
// long as the row in its place is the one we wrote: when COLMAP has verified
// the pair anew since, the present row is the original. COLMAP 4 may open, and
// so convert, the file in between.

// Puts `rows` in the place of the pairs' two-view geometries, removes those of
// `removed`, and writes the corrections of priors, all in one transaction. What
// an earlier call replaced is put back first, so calling twice equals calling
// once. On error nothing has changed.
Status RewriteTwoViewGeometries(
    const std::string& database_path,
    const std::vector<NewTwoViewGeometry>& rows,
    const std::vector<ImagePair>& removed,
    const std::optional<Eigen::Quaterniond>& camera_mount = {},
    const std::vector<InertialLength>& lengths = {});

struct RestoreSummary {
  int num_restored = 0;
  // Rows that COLMAP has replaced in the meantime, or whose images changed.
  int num_outdated = 0;
  // The priors had been corrected, and are as imported again.
  bool priors_restored = false;
};

// Puts all originals that count back and drops the tables, those of corrected
// priors too, in one transaction. Originals that do not count stay in their
// table. In a file of COLMAP 4's form, matrices and poses of zeros come back as
// NULL, as that form says "none". Without the tables there is nothing to do,
// and nothing is changed.
StatusOr<RestoreSummary> RestoreTwoViewGeometries(
    const std::string& database_path);

// The pairs that have a kept original that counts; throws SqliteError.
std::vector<ImagePair> FindKeptOriginals(SqliteConnection* database);

inline constexpr char kTwoViewGeometryBackupTable[] =
    "adasfm_two_view_geometries";

}  // namespace adasfm
