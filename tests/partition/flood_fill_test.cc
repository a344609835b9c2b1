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
  const FloodFillResult result =
      ExpandByFloodFill({}, BuildFigureGraph(), FigureParts());
  ASSERT_FALSE(result.layers.empty());
  EXPECT_EQ(result.layers[0], (Parts{{9, 20}, {8, 18}, {8, 16}}));
}

TEST(FloodFill, ZeroRatioLeavesThePartsAlone) {
  FloodFillOptions options;
  options.min_overlap_ratio = 0.0;
  EXPECT_EQ(ExpandByFloodFill(options, BuildFigureGraph(), FigureParts()).parts,
            FigureParts());
}

TEST(FloodFill, PrefersTheStrongestEdge) {
  //  1 - 2 - 3 | 4 - 5 - 6, and 3 - 5 stronger than 3 - 4.
  ImageGraph graph;
  for (image_t i = 1; i < 6; ++i) AddEdge(i, i + 1, 10.0, &graph);
  AddEdge(3, 5, 11.0, &graph);
  const FloodFillResult result =
      ExpandByFloodFill({}, graph, {{1, 2, 3}, {4, 5, 6}});
  EXPECT_EQ(result.layers[0][0], std::vector<image_t>{5});
}

// One camera after another: each layer adds one image at each end.
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
    FloodFillOptions options;
    options.min_overlap_ratio = ratio;
    const FloodFillResult result = ExpandByFloodFill(options, graph, parts);
    for (const double part_ratio : ComputeOverlapRatios(result.parts)) {
      EXPECT_GE(part_ratio, ratio);
    }
    for (int k = 0; k < kNumParts; ++k) {
      EXPECT_TRUE(std::includes(result.parts[k].begin(), result.parts[k].end(),
                                parts[k].begin(), parts[k].end()));
      // What it takes counts as shared, so it stops at the latest with
      // a / (size + a) = ratio; a layer adds one image at each end.
      EXPECT_LE(result.parts[k].size(), kPartSize / (1.0 - ratio) + 2.0);
      // A chain's part stays one interval.
      EXPECT_EQ(result.parts[k].back() - result.parts[k].front() + 1,
                result.parts[k].size());
    }
  }
}

TEST(FloodFill, EndsWhenNothingIsAdjacent) {
  ImageGraph graph;
  AddEdge(1, 2, 1.0, &graph);
  AddEdge(3, 4, 1.0, &graph);
  const Parts parts = {{1, 2}, {3, 4}};
  EXPECT_EQ(ExpandByFloodFill({}, graph, parts).parts, parts);
}

TEST(FloodFill, RatioOutOfRangeIsNamed) {
  FloodFillOptions options;
  options.min_overlap_ratio = 1.0;
  std::string error;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("min_overlap_ratio"), std::string::npos);
  EXPECT_THROW(ExpandByFloodFill(options, {}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
