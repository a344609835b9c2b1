// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "global/odometry/edge_lengths.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// By edge: those of one number have one unit, through keypoints that both see
// or through metres; -1 where an edge shows no parallax. Lengths of different
// units compare by the depth of the scene only. lengths: as EstimateEdgeLengths
// found them for this graph with the same metres.
std::vector<int> FindLengthUnits(
    const EdgeLengthOptions& options, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences, const EdgeLengths& lengths);

// What: the parts of a view graph within which all distances compare. Where a
// camera turns on the spot and no keypoint is seen both before and behind, or
// an image hangs on one pair, directions and rotations tie two parts together
// while nothing tells how large one is against the other.
// Inputs: the graph; units: by edge, of FindLengthUnits; centers: of images,
// as they come out when all is taken for one part.
// Method. The images of the edges of one unit are rigid but for their size.
// Two of these sets that share two images are of one size, as are those that
// closed rings of sets tell (sizes_by_closure.h). Edges with metres
// (ViewGraphEdge::length_m) are one set. Sets that share one image only are
// hinged there: the image goes to the larger one. Images that no such edge
// reaches join the part that they share the most inliers with.
// Returns a part for each image of the graph, named by the smallest index of
// its images. On failure: nothing to fail.
std::vector<int> FindPartsOfOneUnit(
    const ViewGraph& graph, const std::vector<int>& units,
    const std::map<image_t, Eigen::Vector3d>& centers);

}  // namespace adasfm
