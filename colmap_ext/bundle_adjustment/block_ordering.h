// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace adasfm {

// An order in which a symmetric matrix of blocks has a Cholesky factor of
// little fill, with one row and column of blocks for each node of a graph and
// blocks where nodes are neighbours.
struct BlockOrdering {
  // By its new number, the old number of each block.
  std::vector<int> block_of_number;
  // Of the factor, below its diagonal.
  size_t num_factor_blocks = 0;
};

// Method: CHOLMOD's, minimum degree or nested dissection (METIS), whichever has
// less fill, in postorder.
//
// Input: for each node its neighbours, by index, every edge at one of its
// nodes; of edges that come twice the second changes nothing. A chain of n
// nodes has n - 1 blocks, a complete graph n (n - 1) / 2. Throws where memory
// is short.
BlockOrdering FindBlockOrdering(const std::vector<std::vector<int>>& neighbors);

}  // namespace adasfm
