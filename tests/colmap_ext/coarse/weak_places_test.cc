// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/weak_places.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

ViewGraphEdge Edge(image_t image_id1, image_t image_id2, int num_inliers,
                   EdgeRemoval removal) {
  ViewGraphEdge edge;
  edge.image_id1 = image_id1;
  edge.image_id2 = image_id2;
  edge.num_inliers = num_inliers;
  edge.removal = removal;
  return edge;
}

TEST(WeakPlacesTest, TheBestPairStandsForAllBetweenTwoModels) {
  CoarsePoses poses;
  poses.components.resize(3);
  poses.components[0].cams_from_world = {{5, {}}, {6, {}}};
  poses.components[1].cams_from_world = {{1, {}}, {2, {}}};
  poses.components[2].cams_from_world = {{8, {}}, {9, {}}};
  poses.graph.edges = {
      Edge(1, 2, 90, EdgeRemoval::kRotation),  // inside a model
      Edge(1, 5, 20, EdgeRemoval::kRotation),
      Edge(1, 6, 40, EdgeRemoval::kUnconfirmedClosure),
      Edge(2, 5, 30, EdgeRemoval::kRotation),
      Edge(2, 7, 50, EdgeRemoval::kRotation),  // 7 is in no model
      Edge(5, 6, 90, EdgeRemoval::kKept)};
  poses.graph.edges.push_back(Edge(6, 8, 70, EdgeRemoval::kFalseLoop));
  poses.graph.edges.back().source = EdgeSource::kSensor;
  const std::vector<WeakPlace> places = FindWeakPlaces(poses);
  ASSERT_EQ(places.size(), 1);
  EXPECT_EQ(places[0].model1, 0);
  EXPECT_EQ(places[0].model2, 1);
  EXPECT_EQ(places[0].pair, ImagePair(1, 6));
  EXPECT_EQ(places[0].num_inliers, 40);
  EXPECT_EQ(places[0].num_pairs, 3);
  EXPECT_EQ(places[0].removal, EdgeRemoval::kUnconfirmedClosure);
}

}  // namespace
}  // namespace adasfm
