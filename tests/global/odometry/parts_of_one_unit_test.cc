// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/parts_of_one_unit.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "global/odometry/edge_lengths.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 9;
constexpr image_t kHinge = 5;

// Nine images in a row. A camera that turns on the spot at the fifth: no pair
// leads past it, and no landmark is matched both before and behind.
//   1 - 2 - 3 - 4 - 5 - 6 - 7 - 8 - 9
TestScene BuildHingedScene(bool shares_landmarks) {
  TestSceneOptions options;
  options.num_images = kNumImages;
  options.max_gap = 2;
  TestScene scene = BuildTestScene(options, 1);
  auto& edges = scene.graph.edges;
  edges.erase(std::remove_if(edges.begin(), edges.end(),
                             [](const ViewGraphEdge& edge) {
                               return edge.image_id1 < kHinge &&
                                      edge.image_id2 > kHinge;
                             }),
              edges.end());
  if (shares_landmarks) return scene;
  for (auto& [pair, matches] : scene.correspondences.matches) {
    const point2D_t parity = pair.image_id1 < kHinge ? 0 : 1;
    matches.erase(std::remove_if(matches.begin(), matches.end(),
                                 [parity](const FeatureMatch& match) {
                                   return match.point2D_idx1 % 2 != parity;
                                 }),
                  matches.end());
  }
  return scene;
}

std::vector<int> PartsOf(const TestScene& scene,
                         const std::map<ImagePair, double>& known_lengths_m) {
  const EdgeLengthOptions options;
  const EdgeLengths lengths = EstimateEdgeLengths(
      options, scene.graph, known_lengths_m, scene.correspondences);
  return FindPartsOfOneUnit(
      scene.graph, FindLengthUnits(options, scene.graph, known_lengths_m,
                                   scene.correspondences, lengths));
}

TEST(FindPartsOfOneUnit, SharedLandmarksTieSizes) {
  EXPECT_EQ(PartsOf(BuildHingedScene(true), {}),
            std::vector<int>(kNumImages, 0));
}

TEST(FindPartsOfOneUnit, SplitsAtAHinge) {
  // The hinge goes to the first of two sets of five.
  EXPECT_EQ(PartsOf(BuildHingedScene(false), {}),
            std::vector<int>({0, 0, 0, 0, 0, 5, 5, 5, 5}));
}

TEST(FindPartsOfOneUnit, MetresOnBothSidesTieSizes) {
  const TestScene scene = BuildHingedScene(false);
  EXPECT_EQ(PartsOf(scene, {{ImagePair(1, 2), 1.0}, {ImagePair(8, 9), 1.0}}),
            std::vector<int>(kNumImages, 0));
  EXPECT_EQ(PartsOf(scene, {{ImagePair(1, 2), 1.0}}),
            std::vector<int>({0, 0, 0, 0, 0, 5, 5, 5, 5}));
}

// By hand: units {1, 2, 3}, {3, 4, 5}, and an image that no length reaches.
class Units {
 public:
  void Add(image_t id1, image_t id2, int unit, int num_inliers = 50) {
    ViewGraphEdge edge = BuildEdge({id1, id2}, Rigid3d());
    edge.num_inliers = num_inliers;
    graph.edges.push_back(edge);
    units.push_back(unit);
    for (const image_t id : {id1, id2}) graph.images.push_back(id);
    std::sort(graph.images.begin(), graph.images.end());
    graph.images.erase(std::unique(graph.images.begin(), graph.images.end()),
                       graph.images.end());
  }
  std::vector<int> Parts() const { return FindPartsOfOneUnit(graph, units); }

  ViewGraph graph;
  std::vector<int> units;
};

TEST(FindPartsOfOneUnit, TwoImagesTieSizesAndOneDoesNot) {
  Units world;
  for (const auto& [id1, id2, unit] :
       {std::make_tuple(1, 2, 0), std::make_tuple(2, 3, 0),
        std::make_tuple(3, 4, 1), std::make_tuple(4, 5, 1)}) {
    world.Add(id1, id2, unit);
  }
  EXPECT_EQ(world.Parts(), std::vector<int>({0, 0, 0, 3, 3}));
  // A third unit that both others share one image with only ties nothing; with
  // two of the first it is of that size, and then shares two with the second.
  world.Add(1, 4, 2);
  EXPECT_EQ(world.Parts(), std::vector<int>({0, 0, 0, 3, 3}));
  world.Add(2, 4, 2);
  EXPECT_EQ(world.Parts(), std::vector<int>(5, 0));
}

TEST(FindPartsOfOneUnit, ImagesWithoutALengthJoinTheirStrongestNeighbour) {
  Units world;
  world.Add(1, 2, 0);
  world.Add(3, 4, 1);
  world.Add(2, 5, -1, 20);
  world.Add(3, 5, -1, 40);
  EXPECT_EQ(world.Parts(), std::vector<int>({0, 0, 2, 2, 2}));
}

}  // namespace
}  // namespace adasfm
