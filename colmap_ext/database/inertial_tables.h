// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/database/image_names.h"
#include "core/inertial_motion.h"
#include "core/sqlite.h"

namespace adasfm {

// The tables adasfm_inertial_motions, written by the import, and
// adasfm_inertial_lengths, written by adasfm_global
// (docs/reference/formats.md). Rows are matched by image name, as those of
// prior_tables.h. All functions throw SqliteError: writers for images that the
// database lacks, readers for rows that the writers could not have written.

// Replaces all rows; without motions no table is created.
void WriteInertialMotions(const ImageNames& names,
                          const std::vector<InertialMotion>& motions,
                          SqliteConnection* database);
// Replaces all rows; without lengths removes the table.
void WriteInertialLengths(const std::vector<InertialLength>& lengths,
                          SqliteConnection* database);

// In the order in which they were written; empty without the table. Rows of
// images that the database lacks are skipped, and counted in num_ignored_rows.
std::vector<InertialMotion> ReadInertialMotions(const ImageNames& names,
                                                SqliteConnection* database,
                                                int* num_ignored_rows);
// As above, without a count: the priors of such images are skipped, too.
std::vector<InertialLength> ReadInertialLengths(SqliteConnection* database);

inline constexpr char kInertialLengthTable[] = "adasfm_inertial_lengths";

}  // namespace adasfm
