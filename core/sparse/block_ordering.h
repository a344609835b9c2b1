// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace adasfm {

// An order in which a symmetric block matrix has a Cholesky factor of little
// fill. Each node of a graph is a row and a column of blocks; the matrix has a
// block off the diagonal where two nodes are neighbours.
struct BlockOrdering {
  // The old number of each block, by its new number.
  std::vector<int> block_of_number;
  // Blocks of the factor below its diagonal.
  size_t num_factor_blocks = 0;
};

// Method: that with least fill of minimum degree, nested dissection by METIS
// and, for many blocks, CHOLMOD's own, in postorder.
//
// Input: for each node the indices of its neighbours; every edge is listed at
// one of its nodes, and repeated edges change nothing. A chain of n nodes has
// n - 1 blocks, a complete graph n (n - 1) / 2. Throws where memory is short.
BlockOrdering FindBlockOrdering(const std::vector<std::vector<int>>& neighbors);

// At least num_factor_blocks of FindBlockOrdering: without CHOLMOD's own
// dissection, the slowest method.
size_t BoundNumFactorBlocks(const std::vector<std::vector<int>>& neighbors);

}  // namespace adasfm
