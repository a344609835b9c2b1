// SPDX-License-Identifier: BSD-3-Clause
#include "partition/normalized_cut.h"

#include <gtest/gtest.h>

#include <map>

#include "core/random.h"

namespace adasfm {
namespace {

void AddEdge(image_t a, image_t b, double weight, ImageGraph* graph) {
  graph->images.insert(a);
  graph->images.insert(b);
  graph->edges[ImagePair(a, b)] = weight;
}

// A drive: neighbours up to `reach` with falling weights, and a few places
// visited twice.
ImageGraph BuildDrive(int num_images, int reach, uint64_t seed) {
  Random random(seed);
  ImageGraph graph;
  for (int i = 0; i < num_images; ++i) {
    for (int j = i + 1; j <= std::min(num_images - 1, i + reach); ++j) {
      AddEdge(i, j, 300.0 / (j - i) + random.Uniform(0.0, 10.0), &graph);
    }
  }
  for (int loop = 0; loop < num_images / 100; ++loop) {
    const int a = random.UniformInt(0, num_images - 10);
    const int b = random.UniformInt(0, num_images - 10);
    if (std::abs(a - b) < 30) continue;
    for (int k = 0; k < 8; ++k) AddEdge(a + k, b + k, 60.0, &graph);
  }
  return graph;
}

TEST(NormalizedCut, PartsAreBoundedConnectedAndDisjoint) {
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    for (const int num_images : {90, 401, 1000}) {
      const int reach = 1 + 3 * (seed % 3);
      const ImageGraph graph = BuildDrive(num_images, reach, seed);
      NormalizedCutOptions options;
      options.max_part_size = 100;
      const auto parts = ComputeNormalizedCut(options, graph);
      const ImageAdjacency adjacency = BuildAdjacency(graph);
      std::map<image_t, int> count;
      for (const auto& part : parts) {
        EXPECT_LE(part.size(), options.max_part_size);
        EXPECT_GE(part.size(), options.min_part_size);
        EXPECT_EQ(FindConnectedComponents(adjacency, {part.begin(), part.end()})
                      .size(),
                  1);
        for (const image_t image_id : part) ++count[image_id];
      }
      EXPECT_EQ(count.size(), num_images);
      for (const auto& [image_id, num_parts] : count) EXPECT_EQ(num_parts, 1);
      EXPECT_EQ(parts, ComputeNormalizedCut(options, graph));
    }
  }
}

// Two dense groups and one thin bridge: the cut must be the bridge.
TEST(NormalizedCut, CutsTheWeakLink) {
  ImageGraph graph;
  for (image_t group = 0; group < 2; ++group) {
    for (image_t i = 0; i < 30; ++i) {
      for (image_t j = i + 1; j < 30; ++j) {
        AddEdge(100 * group + i, 100 * group + j, 50.0, &graph);
      }
    }
  }
  AddEdge(29, 100, 5.0, &graph);
  NormalizedCutOptions options;
  options.max_part_size = 40;
  const auto parts = ComputeNormalizedCut(options, graph);
  ASSERT_EQ(parts.size(), 2);
  EXPECT_EQ(parts[0].back(), 29);
  EXPECT_EQ(parts[1].front(), 100);
}

TEST(NormalizedCut, SmallGraphIsOnePart) {
  EXPECT_EQ(ComputeNormalizedCut({}, BuildDrive(50, 3, 1)).size(), 1);
  EXPECT_TRUE(ComputeNormalizedCut({}, {}).empty());
}

TEST(NormalizedCut, TinyComponentIsLeftOutBesideALargerOne) {
  ImageGraph graph = BuildDrive(50, 3, 1);
  AddEdge(900, 901, 50.0, &graph);
  const auto parts = ComputeNormalizedCut({}, graph);
  ASSERT_EQ(parts.size(), 1);
  EXPECT_EQ(parts[0].size(), 50);
  NormalizedCutOptions options;
  options.min_part_size = 2;
  EXPECT_EQ(ComputeNormalizedCut(options, graph).size(), 2);
}

TEST(NormalizedCut, WrongOptionsAreNamed) {
  NormalizedCutOptions options;
  options.max_part_size = 5;
  std::string error;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("max_part_size = 5"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
