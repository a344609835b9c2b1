// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "global/loop_closures/drive_parts.h"
#include "global/loop_closures/filter_unverified_joins.h"
#include "global/loop_closures/join_cells.h"

namespace adasfm {

// Which of the cells between two parts agree with each other at two places or
// more, by cell; all false where nothing confirms the join. Of several such
// agreements that with most pairs. cells: at least one.
std::vector<bool> ConfirmJoin(const JoinFilterOptions& options,
                              const DriveParts& parts,
                              const std::vector<JoinCell>& cells);

}  // namespace adasfm
