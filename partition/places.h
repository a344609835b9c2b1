// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>

#include "core/types.h"
#include "partition/image_graph.h"

namespace adasfm {

// The place of each image of the graph: images of a camera at rest, which are
// connected by edges and less than 2 % of a wide baseline (the 0.9 quantile
// over all edges) apart from the smallest of them, are one place and named by
// it. Images without a position are a place each.
// `positions`: camera centres in a common frame, any unit.
std::map<image_t, image_t> FindPlaces(
    const ImageGraph& graph,
    const std::map<image_t, Eigen::Vector3d>& positions);

// The graph of places: between two of them the sum of the weights of all edges
// between their images. In its parts of several places points have depth.
ImageGraph MergePlaces(const ImageGraph& graph,
                       const std::map<image_t, image_t>& place_of_image);

}  // namespace adasfm
