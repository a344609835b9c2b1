// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "partition/image_graph.h"

namespace adasfm {

struct FloodFillOptions {
  // tau_ot: the share of a part's images that other parts have too. Alignment
  // and merging rest on them; the paper's value.
  double min_overlap_ratio = 0.3;

  bool IsValid(std::string* error) const;
};

// Adaptive flood fill (paper, section on graph partition and Alg. 1). Layer by
// layer, the separators of a part (its images with an edge to an image outside)
// each take the strongest such image, until tau_ot of the part is shared. A
// part stops on its own, so dense cuts need one layer and thin chains as many
// as it takes.
//
// The paper's text lets every separator take an image; its Alg. 1 gives every
// edge to the smallest part that has one of its ends. The figure needs both
// rules, and so does this function: edges go by falling weight (ties by ids),
// each one to the smallest part (ties by index) with exactly one end inside
// whose separator has taken nothing in this layer; an edge serves once a layer.
// Returns the parts with their overlap, in the order given, images sorted by
// id.
std::vector<std::vector<image_t>> ExpandByFloodFill(
    const FloodFillOptions& options, const ImageGraph& graph,
    const std::vector<std::vector<image_t>>& parts);

// The share of each part's images that lie in another part too.
std::vector<double> ComputeOverlapRatios(
    const std::vector<std::vector<image_t>>& parts);

}  // namespace adasfm
