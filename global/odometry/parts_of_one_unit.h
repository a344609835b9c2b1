// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "global/odometry/edge_lengths.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Unit by edge: edges of one number share a unit, through keypoints that both
// see or through metres; -1 where an edge shows no parallax. Lengths of
// different units are comparable only by the depth of the scene. lengths: as
// EstimateEdgeLengths found them for this graph with the same metres.
std::vector<int> FindLengthUnits(
    int num_threads, const ViewGraph& graph,
    const std::map<ImagePair, double>& known_lengths_m,
    const GlobalCorrespondences& correspondences, const EdgeLengths& lengths);

// Splits a view graph into parts within which all distances are comparable.
// Where a camera rotates on the spot and no keypoint is seen both before and
// after, or an image has a single pair, directions and rotations connect two
// parts but do not determine their relative scale. units: by edge, of
// FindLengthUnits. centers: of images, estimated as if all were one part.
//
// The images of the edges of one unit are rigid up to scale. Two of these sets
// that share two images have one scale, as have those in closed rings that
// determine it (sizes_by_closure.h). Edges with metres
// (ViewGraphEdge::length_m) are one set. Sets that share one image only keep
// separate scales, and the larger set gets the image. Images that a standstill
// joins (ViewGraphEdge::IsJoinAtRest) are one place and count as one image.
// Images that no such edge reaches join a part by their strongest edge.
// Returns a part for each image of the graph, named by the smallest index of
// its images.
std::vector<int> FindPartsOfOneUnit(
    const ViewGraph& graph, const std::vector<int>& units,
    const std::map<image_t, Eigen::Vector3d>& centers);

}  // namespace adasfm
