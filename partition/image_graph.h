// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/types.h"

namespace adasfm {

// The view graph for the partition: images and undirected edges. The weight of
// an edge (> 0) is the strength of the connection between its images, e.g. the
// number of inlier matches.
struct ImageGraph {
  std::set<image_t> images;
  std::map<ImagePair, double> edges;
};

// The neighbours of each image, strongest first, ties by id. Every image of the
// graph has an entry.
using ImageAdjacency =
    std::map<image_t, std::vector<std::pair<image_t, double>>>;
ImageAdjacency BuildAdjacency(const ImageGraph& graph);

// The connected components of the graph restricted to `images`, largest first,
// ties by smallest id; each sorted by id.
std::vector<std::vector<image_t>> FindConnectedComponents(
    const ImageAdjacency& adjacency, const std::set<image_t>& images);

}  // namespace adasfm
