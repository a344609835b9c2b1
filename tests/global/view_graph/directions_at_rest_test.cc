// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/directions_at_rest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// Images 1 to 6 drive, 7 to 20 stand, 21 to 26 drive on; pairs up to four
// images apart. The pairs of noise are of the standstill.
ViewGraph BuildStop(const std::vector<ImagePair>& noise) {
  ViewGraph graph;
  for (image_t i = 1; i <= 26; ++i) {
    graph.images.push_back(i);
    for (image_t j = i + 1; j <= std::min<image_t>(26, i + 4); ++j) {
      ViewGraphEdge edge = BuildEdge(ImagePair(i, j), Rigid3d());
      const bool stands = i >= 7 && j <= 20;
      edge.has_baseline = edge.has_translation =
          !stands ||
          std::count(noise.begin(), noise.end(), ImagePair(i, j)) > 0;
      graph.edges.push_back(edge);
    }
  }
  return graph;
}

TEST(DropDirectionsAtRest, OfNoiseAlone) {
  // At either end of the stop, in its middle, and two of one image.
  const std::vector<ImagePair> noise = {{7, 9}, {12, 16}, {13, 16}, {17, 20}};
  ViewGraph graph = BuildStop(noise);
  const ViewGraph truth = BuildStop({});
  EXPECT_EQ(DropDirectionsAtRest(&graph), static_cast<int>(noise.size()));
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    EXPECT_EQ(graph.edges[e].has_baseline, truth.edges[e].has_baseline)
        << graph.edges[e].image_id1 << ", " << graph.edges[e].image_id2;
    EXPECT_EQ(graph.edges[e].has_translation, graph.edges[e].has_baseline);
  }
}

// A camera that creeps: only images more than two apart have a baseline. Their
// directions are all that there is, and stay.
TEST(DropDirectionsAtRest, NotOfACameraThatCreeps) {
  ViewGraph graph;
  for (image_t i = 1; i <= 20; ++i) {
    graph.images.push_back(i);
    for (image_t j = i + 1; j <= std::min<image_t>(20, i + 8); ++j) {
      ViewGraphEdge edge = BuildEdge(ImagePair(i, j), Rigid3d());
      edge.has_baseline = edge.has_translation = j - i > 2;
      graph.edges.push_back(edge);
    }
  }
  EXPECT_EQ(DropDirectionsAtRest(&graph), 0);
}

}  // namespace
}  // namespace adasfm
