// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "colmap_ext/database/merge_ids.h"
#include "core/sqlite.h"

namespace adasfm {

// Copies the rows of a table that both databases have, with the new ids and
// with the prefix before names. Columns are recognised by their names, so that
// tables of all versions of COLMAP and the adasfm_ tables are copied alike;
// other columns are copied byte for byte. A row that the target has already is
// skipped when it is equal; otherwise throws SqliteError with the image or pair
// and the input's path. Returns the number of new rows.
int64_t MergeRows(const std::string& table, const DatabaseKeys& input,
                  const MergedIds& ids, SqliteConnection* source,
                  SqliteConnection* target);

}  // namespace adasfm
