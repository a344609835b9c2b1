// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "colmap_ext/pairs/vlad.h"
#include "core/progress.h"

namespace adasfm {

// For every row, the nearest other rows, nearest first (equally near ones by
// index): at most num_neighbors rows for which may_be_chosen(row, neighbor) is
// true; an empty may_be_chosen allows all. may_be_chosen is called from several
// threads. All distances are computed.
std::vector<std::vector<int>> FindNearestRows(
    const RowMatrixXf& vectors, int num_neighbors, int num_threads,
    const std::function<bool(int, int)>& may_be_chosen = {},
    const ProgressCallback& progress = {});

}  // namespace adasfm
