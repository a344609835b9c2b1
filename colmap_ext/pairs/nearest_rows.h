// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/pairs/vlad.h"
#include "core/progress.h"

namespace adasfm {

// For every row the rows nearest to it, nearest first, at most num_neighbors
// and never itself; exact search by FLANN.
std::vector<std::vector<int>> FindNearestRows(
    const RowMatrixXf& vectors, int num_neighbors, int num_threads,
    const ProgressCallback& progress = {});

}  // namespace adasfm
