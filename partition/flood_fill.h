// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/types.h"
#include "partition/image_graph.h"

namespace adasfm {

// Adaptive flood fill (paper, section on graph partition and Alg. 1). The
// separators of a part are its images with an edge to an image outside. Layer
// by layer, each separator takes its strongest neighbour outside, until tau_ot
// of the part is shared. Each part stops by itself: dense cuts need one layer,
// thin chains as many as necessary. `min_overlap_ratio`, in [0, 1), is tau_ot:
// the share of a part's images that other parts contain, too; alignment and
// merging rely on these images.
//
// In the paper's text every separator takes an image; in its Alg. 1 every edge
// is given to the smallest part that has one of its ends. The figure needs both
// rules, and this function applies both. Edges are processed by falling weight
// (ties by ids). Each edge is given to the smallest part (ties by index) that
// has exactly one end inside and whose separator has taken nothing in this
// layer; an edge is used once per layer. Returns the parts with their overlap,
// in the order given, images sorted by id.
std::vector<std::vector<image_t>> ExpandByFloodFill(
    double min_overlap_ratio, const ImageGraph& graph,
    const std::vector<std::vector<image_t>>& parts);

// The share of each part's images that lie in another part too.
std::vector<double> ComputeOverlapRatios(
    const std::vector<std::vector<image_t>>& parts);

}  // namespace adasfm
