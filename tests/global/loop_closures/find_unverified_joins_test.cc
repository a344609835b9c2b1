// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/find_unverified_joins.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/random.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// Pieces of 20 images in a row, edges to the next three, nothing between them:
//   1 ... 20 | 41 ... 60 | 81 ... 100 | ...
ViewGraph BuildPieces(int num_pieces) {
  ViewGraph graph;
  for (int piece = 0; piece < num_pieces; ++piece) {
    const image_t first = 40 * piece + 1;
    for (image_t i = first; i < first + 20; ++i) {
      graph.images.push_back(i);
      for (image_t j = i + 1; j <= std::min(i + 3, first + 19); ++j) {
        graph.edges.push_back(BuildEdge(ImagePair(i, j), Rigid3d()));
        graph.edges.back().num_inliers = 100;
      }
    }
  }
  return graph;
}

// Pairs (i, j), (i + 1, j + 1), ...: one place.
void AddPlace(image_t i, image_t j, int num_pairs, ViewGraph* graph) {
  for (int k = 0; k < num_pairs; ++k) {
    graph->edges.push_back(BuildEdge(ImagePair(i + k, j + k), Rigid3d()));
    graph->edges.back().num_inliers = 20 + k;
  }
  std::sort(graph->edges.begin(), graph->edges.end(),
            [](const ViewGraphEdge& a, const ViewGraphEdge& b) {
              return a.Pair() < b.Pair();
            });
}

TEST(FindUnverifiedJoins, OnePlaceIsNotEnough) {
  ViewGraph graph = BuildPieces(2);
  AddPlace(3, 43, 5, &graph);
  const auto joins = FindUnverifiedJoins(UnverifiedJoinOptions(), graph);
  ASSERT_EQ(joins.size(), 1);
  EXPECT_EQ(joins[0].num_pairs, 5);
  EXPECT_EQ(joins[0].num_images, 20);
  // The strongest pair.
  EXPECT_EQ(joins[0].image_id1, 7);
  EXPECT_EQ(joins[0].image_id2, 47);
}

TEST(FindUnverifiedJoins, ASecondPlaceConfirms) {
  ViewGraph graph = BuildPieces(2);
  AddPlace(1, 41, 3, &graph);
  AddPlace(17, 57, 3, &graph);
  EXPECT_TRUE(FindUnverifiedJoins(UnverifiedJoinOptions(), graph).empty());
  // Unless it is taken out.
  for (ViewGraphEdge& edge : graph.edges) {
    if (edge.image_id1 >= 17 && edge.image_id2 >= 57 && edge.image_id1 < 21) {
      edge.removal = EdgeRemoval::kRotation;
    }
  }
  EXPECT_EQ(FindUnverifiedJoins(UnverifiedJoinOptions(), graph).size(), 1);
}

//   A - B - C     a ring confirms itself, D hangs on it:
//    \_____/
//   C - D
TEST(FindUnverifiedJoins, RingsConfirmThemselves) {
  ViewGraph graph = BuildPieces(4);
  AddPlace(1, 41, 3, &graph);
  AddPlace(55, 95, 3, &graph);
  AddPlace(10, 90, 3, &graph);
  AddPlace(85, 125, 3, &graph);
  const auto joins = FindUnverifiedJoins(UnverifiedJoinOptions(), graph);
  ASSERT_EQ(joins.size(), 1);
  EXPECT_EQ(joins[0].image_id1, 87);
  EXPECT_EQ(joins[0].num_images, 20);
  UnverifiedJoinOptions options;
  options.min_num_images = 21;
  EXPECT_TRUE(FindUnverifiedJoins(options, graph).empty());
}

TEST(FindUnverifiedJoins, SequencesAndDisconnectedPartsHaveNone) {
  EXPECT_TRUE(
      FindUnverifiedJoins(UnverifiedJoinOptions(), ViewGraph()).empty());
  EXPECT_TRUE(
      FindUnverifiedJoins(UnverifiedJoinOptions(), BuildPieces(3)).empty());
  ViewGraph graph = BuildPieces(1);
  AddPlace(1, 15, 4, &graph);
  EXPECT_TRUE(FindUnverifiedJoins(UnverifiedJoinOptions(), graph).empty());
  // A sensor edge over the gap makes one piece of two.
  graph = BuildPieces(2);
  AddPlace(3, 43, 5, &graph);
  AddPlace(20, 41, 1, &graph);
  for (ViewGraphEdge& edge : graph.edges) {
    if (edge.Pair() == ImagePair(20, 41)) edge.source = EdgeSource::kSensor;
  }
  EXPECT_TRUE(FindUnverifiedJoins(UnverifiedJoinOptions(), graph).empty());
}

// Against the definition: a join is a place without which there is one
// component more.
TEST(FindUnverifiedJoins, AgreesWithTakingPlacesOut) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const int num_pieces = random.UniformInt(2, 8);
    std::vector<ImagePair> places;
    const int num_places = random.UniformInt(1, 10);
    for (int k = 0; k < num_places; ++k) {
      // Places of one piece are 15 images apart, so each is its own.
      const int a = random.UniformInt(0, num_pieces - 2);
      const int b = random.UniformInt(a + 1, num_pieces - 1);
      const ImagePair pair(40 * a + 1 + 15 * random.UniformInt(0, 1),
                           40 * b + 1 + 15 * random.UniformInt(0, 1));
      if (std::find(places.begin(), places.end(), pair) == places.end()) {
        places.push_back(pair);
      }
    }
    const auto build = [&](const ImagePair* left_out) {
      ViewGraph result = BuildPieces(num_pieces);
      for (const ImagePair& place : places) {
        if (left_out != nullptr && place == *left_out) continue;
        AddPlace(place.image_id1, place.image_id2, 1, &result);
      }
      return result;
    };
    const size_t num_components =
        FindConnectedComponents(build(nullptr)).size();
    std::vector<ImagePair> expected;
    for (const ImagePair& place : places) {
      if (FindConnectedComponents(build(&place)).size() > num_components) {
        expected.push_back(place);
      }
    }
    std::sort(expected.begin(), expected.end());
    std::vector<ImagePair> actual;
    for (const UnverifiedJoin& join :
         FindUnverifiedJoins(UnverifiedJoinOptions(), build(nullptr))) {
      actual.emplace_back(join.image_id1, join.image_id2);
    }
    ASSERT_EQ(actual.size(), expected.size()) << "seed " << seed;
    for (size_t k = 0; k < actual.size(); ++k) {
      EXPECT_TRUE(actual[k] == expected[k]) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace adasfm
