// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace adasfm {

// How many blocks a sparse Cholesky factor has below its diagonal, for a
// symmetric matrix with one row and column of blocks for each node and blocks
// where nodes are neighbours. The elimination order is that of approximate
// minimum degree, as the solver's (Amestoy, Davis and Duff 1996); the blocks
// are counted along the elimination tree (Davis, LDL, 2005), in time linear in
// their number.
//
// Input: for each node its neighbours, by index, every edge at one of its
// nodes. A chain of n nodes has n - 1 blocks, a complete graph
// n (n - 1) / 2.
size_t CountFactorBlocks(const std::vector<std::vector<int>>& neighbors);

}  // namespace adasfm
