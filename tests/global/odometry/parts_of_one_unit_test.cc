// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/parts_of_one_unit.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "global/estimate_coarse_poses.h"
#include "global/odometry/edge_lengths.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 9;
constexpr image_t kHinge = 5;

// Nine images in a row, with a camera that rotates on the spot at the fifth: no
// pair spans it and, unless shares_landmarks, no landmark is matched both
// before and behind.
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
  constexpr int kNumThreads = -1;
  const EdgeLengths lengths = EstimateEdgeLengths(
      kNumThreads, scene.graph, known_lengths_m, scene.correspondences);
  return FindPartsOfOneUnit(
      scene.graph,
      FindLengthUnits(kNumThreads, scene.graph, known_lengths_m,
                      scene.correspondences, lengths),
      {});
}

TEST(FindPartsOfOneUnit, SharedLandmarksTieSizes) {
  EXPECT_EQ(PartsOf(BuildHingedScene(true), {}),
            std::vector<int>(kNumImages, 0));
}

TEST(FindPartsOfOneUnit, SplitsAtAHinge) {
  // The hinge belongs to two sets of five and is assigned to the first.
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

// The rotations of an IMU do not connect the scales beside the hinge.
TEST(FindPartsOfOneUnit, CoarsePosesSplitAtAHingeWithAnImuToo) {
  Random random(1);
  for (const bool shares_landmarks : {true, false}) {
    const TestScene scene = BuildHingedScene(shares_landmarks);
    std::vector<RelativePosePrior> priors;
    for (image_t id = 1; id < kNumImages; ++id) {
      const Rigid3d motion = scene.cams_from_world.at(id + 1) *
                             scene.cams_from_world.at(id).Inverse();
      priors.push_back(BuildPrior(id, id + 1, motion, 1e-3, 0.1, &random));
      priors.back().flags = kPriorRotation;
    }
    const CoarsePoses poses = EstimateCoarsePoses(
        CoarsePoseOptions(), scene.graph, scene.correspondences, priors);
    EXPECT_EQ(poses.components.size(), shares_landmarks ? 1 : 2);
  }
}

// A graph made by hand, with the unit of each edge.
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
  std::vector<int> Parts() const {
    return FindPartsOfOneUnit(graph, units, centers);
  }

  ViewGraph graph;
  std::vector<int> units;
  std::map<image_t, Eigen::Vector3d> centers;
};

TEST(FindPartsOfOneUnit, TwoImagesTieSizesAndOneDoesNot) {
  Units world;
  for (const auto& [id1, id2, unit] :
       {std::make_tuple(1, 2, 0), std::make_tuple(2, 3, 0),
        std::make_tuple(3, 4, 1), std::make_tuple(4, 5, 1)}) {
    world.Add(id1, id2, unit);
  }
  EXPECT_EQ(world.Parts(), std::vector<int>({0, 0, 0, 3, 3}));
  // A third unit that shares one image with each of the others connects
  // nothing. With two images of the first it has the first's size, and both
  // then share two images with the second.
  world.Add(1, 4, 2);
  EXPECT_EQ(world.Parts(), std::vector<int>({0, 0, 0, 3, 3}));
  world.Add(2, 4, 2);
  EXPECT_EQ(world.Parts(), std::vector<int>(5, 0));
}

// Image 4 is at rest where 3 is. A pair of it whose direction is noise has a
// unit of its own, and takes it away unless both images are one place.
TEST(FindPartsOfOneUnit, ImagesAtRestAreOnePlace) {
  for (const bool is_at_rest : {false, true}) {
    Units world;
    world.Add(1, 2, 0);
    world.Add(2, 3, 0);
    world.Add(3, 4, -1);
    world.graph.edges.back().has_baseline = !is_at_rest;
    world.Add(4, 5, 1);
    world.Add(5, 6, 0);
    EXPECT_EQ(world.Parts(), is_at_rest ? std::vector<int>(6, 0)
                                        : std::vector<int>({0, 0, 0, 3, 0, 0}));
  }
}

// Units {1, 2, 3} and {4, 5, 6}; each bar (edge) between them is one more.
Units BuildUnitsWithBars(const std::vector<std::pair<image_t, image_t>>& bars,
                         const std::map<image_t, Eigen::Vector3d>& centers) {
  Units world;
  for (const auto& [id1, id2, unit] :
       {std::make_tuple(1, 2, 0), std::make_tuple(2, 3, 0),
        std::make_tuple(4, 5, 1), std::make_tuple(5, 6, 1)}) {
    world.Add(id1, id2, unit);
  }
  for (const auto& [id1, id2] : bars) {
    world.Add(id1, id2, 2 + static_cast<int>(world.units.size()));
  }
  for (ViewGraphEdge& edge : world.graph.edges) {
    edge.direction_sigma_rad = 0.005;
  }
  world.centers = centers;
  return world;
}

//   3 ---- 6
//   2     / 5    with 3 - 4 a diagonal: the triangle 3, 4, 6 is closed.
//   1     4
TEST(FindPartsOfOneUnit, AClosedTriangleOfUnitsTiesTheirSizes) {
  std::map<image_t, Eigen::Vector3d> centers;
  for (int i = 0; i < 3; ++i) {
    centers[1 + i] = Eigen::Vector3d(0.0, i, 0.0);
    centers[4 + i] = Eigen::Vector3d(3.0 + 0.5 * i, i, 0.0);
  }
  EXPECT_EQ(BuildUnitsWithBars({{3, 6}}, centers).Parts(),
            std::vector<int>({0, 0, 0, 3, 3, 3}));
  // The bars have the size of the second unit; the first is hinged at image 3.
  EXPECT_EQ(BuildUnitsWithBars({{3, 6}, {3, 4}}, centers).Parts(),
            std::vector<int>({0, 0, 2, 2, 2, 2}));
  // A third bar, to another image of the first unit, closes one more triangle.
  EXPECT_EQ(BuildUnitsWithBars({{3, 6}, {3, 4}, {1, 4}}, centers).Parts(),
            std::vector<int>(6, 0));
}

// The sizes of a ring of four bars with four directions are free if it lies in
// a plane, and constrained if it does not.
TEST(FindPartsOfOneUnit, ARingOfFourTiesSizesOutOfItsPlaneOnly) {
  std::map<image_t, Eigen::Vector3d> centers;
  for (int i = 0; i < 3; ++i) {
    centers[1 + i] = Eigen::Vector3d(0.0, i, 0.0);
    centers[4 + i] = Eigen::Vector3d(3.0 + 0.5 * i, 0.5 + i, 0.0);
  }
  EXPECT_EQ(BuildUnitsWithBars({{1, 4}, {3, 6}}, centers).Parts(),
            std::vector<int>({0, 0, 0, 3, 3, 3}));
  centers[6].z() = 3.0;
  centers[4].z() = -1.0;
  EXPECT_EQ(BuildUnitsWithBars({{1, 4}, {3, 6}}, centers).Parts(),
            std::vector<int>(6, 0));
}

// A triangle with all sides on one line allows any proportion of sizes.
TEST(FindPartsOfOneUnit, ARingInOneLineTiesNothing) {
  std::map<image_t, Eigen::Vector3d> centers;
  for (int i = 1; i <= 6; ++i) centers[i] = Eigen::Vector3d(i, 0.0, 0.0);
  EXPECT_EQ(BuildUnitsWithBars({{1, 4}, {3, 6}}, centers).Parts(),
            std::vector<int>({0, 0, 0, 3, 3, 3}));
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
