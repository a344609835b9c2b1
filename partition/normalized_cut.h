// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "partition/image_graph.h"

namespace adasfm {

struct NormalizedCutOptions {
  // Bundle adjustment costs more than linearly in a part's images, and a part
  // must fit into memory.
  int max_part_size = 150;
  // Smaller pieces have too few images for a reconstruction of their own.
  int min_part_size = 10;

  bool IsValid(std::string* error) const;
};

// Cuts the graph into connected parts of at most max_part_size images (a part
// may exceed this limit where no cut that was tried meets it without a piece
// smaller than min_part_size). The parts have about the same size and the
// weight of the edges between them is small: with equal sizes the normalised
// cut (Shi and Malik 2000) differs from the cut that METIS minimises by a
// constant factor. Every image lies in one part, except those of connected
// components smaller than min_part_size, which are left out unless there is no
// larger one. Parts are ordered by their smallest id, images by id.
std::vector<std::vector<image_t>> ComputeNormalizedCut(
    const NormalizedCutOptions& options, const ImageGraph& graph);

}  // namespace adasfm
