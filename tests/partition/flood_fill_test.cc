// SPDX-License-Identifier: BSD-3-Clause
#include "partition/flood_fill.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace adasfm {
namespace {

using Parts = std::vector<std::vector<image_t>>;

void AddEdge(image_t a, image_t b, double weight, ImageGraph* graph) {
  graph->images.insert(a);
  graph->images.insert(b);
  graph->edges[ImagePair(a, b)] = weight;
}

// The paper's figure: parts {1..8}, {9..17}, {18..25}, joined inside by chains.
ImageGraph BuildFigureGraph() {
  ImageGraph graph;
  for (image_t i = 1; i < 25; ++i) {
    if (i != 8 && i != 17) AddEdge(i, i + 1, 100.0, &graph);
  }
  for (const auto& [a, b] : std::vector<std::pair<image_t, image_t>>{
           {3, 20}, {7, 9}, {8, 9}, {8, 20}, {16, 19}, {17, 18}}) {
    AddEdge(a, b, 20.0, &graph);
  }
  return graph;
}

Parts FigureParts() {
  return {{1, 2, 3, 4, 5, 6, 7, 8},
          {9, 10, 11, 12, 13, 14, 15, 16, 17},
          {18, 19, 20, 21, 22, 23, 24, 25}};
}

TEST(FloodFill, TakesTheSecondLayerOfThePapersFigure) {
  // The second layer alone reaches this overlap.
  const Parts expanded =
      ExpandByFloodFill(0.01, BuildFigureGraph(), FigureParts());
  Parts expected = FigureParts();
  const Parts layer = {{9, 20}, {8, 18}, {8, 16}};
  for (size_t k = 0; k < layer.size(); ++k) {
    expected[k].insert(expected[k].end(), layer[k].begin(), layer[k].end());
    std::sort(expected[k].begin(), expected[k].end());
  }
  EXPECT_EQ(expanded, expected);
}

TEST(FloodFill, ZeroRatioLeavesThePartsAlone) {
  EXPECT_EQ(ExpandByFloodFill(0.0, BuildFigureGraph(), FigureParts()),
            FigureParts());
}

TEST(FloodFill, PrefersTheStrongestEdge) {
  //  1 - 2 - 3 | 4 - 5 - 6, and 3 - 5 stronger than 3 - 4.
  ImageGraph graph;
  for (image_t i = 1; i < 6; ++i) AddEdge(i, i + 1, 10.0, &graph);
  AddEdge(3, 5, 11.0, &graph);
  const Parts expanded = ExpandByFloodFill(0.3, graph, {{1, 2, 3}, {4, 5, 6}});
  EXPECT_EQ(expanded[0], (std::vector<image_t>{1, 2, 3, 5}));
}

// A chain of cameras: each layer adds one image at each end.
TEST(FloodFill, ThinChainReachesTheOverlap) {
  ImageGraph graph;
  const int kNumParts = 4;
  const int kPartSize = 50;
  Parts parts(kNumParts);
  for (image_t i = 0; i < kNumParts * kPartSize; ++i) {
    parts[i / kPartSize].push_back(i);
    if (i > 0) AddEdge(i - 1, i, 50.0, &graph);
  }
  for (const double ratio : {0.1, 0.3, 0.5}) {
    const Parts expanded = ExpandByFloodFill(ratio, graph, parts);
    for (const double part_ratio : ComputeOverlapRatios(expanded)) {
      EXPECT_GE(part_ratio, ratio);
    }
    for (int k = 0; k < kNumParts; ++k) {
      EXPECT_TRUE(std::includes(expanded[k].begin(), expanded[k].end(),
                                parts[k].begin(), parts[k].end()));
      // Images that a part takes count as shared, so the expansion stops at the
      // latest with a / (size + a) = ratio; a layer adds one image at each end.
      EXPECT_LE(expanded[k].size(), kPartSize / (1.0 - ratio) + 2.0);
      // A chain's part stays one interval.
      EXPECT_EQ(expanded[k].back() - expanded[k].front() + 1,
                expanded[k].size());
    }
  }
}

TEST(FloodFill, EndsWhenNothingIsAdjacent) {
  ImageGraph graph;
  AddEdge(1, 2, 1.0, &graph);
  AddEdge(3, 4, 1.0, &graph);
  const Parts parts = {{1, 2}, {3, 4}};
  EXPECT_EQ(ExpandByFloodFill(0.3, graph, parts), parts);
}

}  // namespace
}  // namespace adasfm
