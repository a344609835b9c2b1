// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "colmap_ext/pairs/vlad.h"
#include "core/progress.h"

namespace adasfm {

// For every row the rows nearest to it, nearest first (of equally near ones
// the first), at most num_neighbors, never itself, and only those of which
// may_be_chosen(row, neighbor) is true; all are when it is empty. It is called
// from several threads. All distances are computed.
std::vector<std::vector<int>> FindNearestRows(
    const RowMatrixXf& vectors, int num_neighbors, int num_threads,
    const std::function<bool(int, int)>& may_be_chosen = {},
    const ProgressCallback& progress = {});

}  // namespace adasfm
