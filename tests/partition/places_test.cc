// SPDX-License-Identifier: BSD-3-Clause
#include "partition/places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/random.h"

namespace adasfm {
namespace {

constexpr int kReach = 8;

struct Drive {
  ImageGraph graph;
  std::map<image_t, Eigen::Vector3d> positions;
};

// Images 1 to num_images, 1 m apart except from first_at_rest to last_at_rest,
// which differ by noise of 5 mm; each is matched with the next kReach ones.
Drive BuildDrive(int num_images, int first_at_rest, int last_at_rest,
                 uint64_t seed) {
  Random random(seed);
  Drive drive;
  double x = 0.0;
  for (int i = 1; i <= num_images; ++i) {
    if (i <= first_at_rest || i > last_at_rest) x += 1.0;
    drive.positions[i] =
        Eigen::Vector3d(x, 0.0, 0.0) + random.GaussianVector(0.005);
    drive.graph.images.insert(i);
    for (int j = std::max(1, i - kReach); j < i; ++j) {
      drive.graph.edges[ImagePair(j, i)] = 100.0 / (i - j);
    }
  }
  return drive;
}

int NumPlaces(const std::map<image_t, image_t>& place_of_image) {
  std::set<image_t> places;
  for (const auto& [image_id, place] : place_of_image) places.insert(place);
  return static_cast<int>(places.size());
}

TEST(Places, AStandstillIsOnePlace) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const Drive drive = BuildDrive(200, 50, 149, seed);
    const auto places = FindPlaces(drive.graph, drive.positions);
    ASSERT_EQ(places.size(), 200);
    EXPECT_EQ(NumPlaces(places), 101);
    for (image_t i = 1; i <= 200; ++i) {
      EXPECT_EQ(places.at(i), i >= 50 && i <= 149 ? 50 : i);
    }
  }
}

TEST(Places, AMovingCameraHasOnePerImage) {
  Drive drive = BuildDrive(100, 0, 0, 1);
  EXPECT_EQ(NumPlaces(FindPlaces(drive.graph, drive.positions)), 100);
  // Nor do a few false pairs across the drive change that.
  for (int i = 1; i <= 30; ++i) {
    drive.graph.edges[ImagePair(i, 60 + i)] = 20.0;
  }
  EXPECT_EQ(NumPlaces(FindPlaces(drive.graph, drive.positions)), 100);
}

// The same place at another time is another place where no pair says that it is
// the same: their images may have nothing to show each other.
TEST(Places, UnmatchedVisitsStayApart) {
  Drive drive = BuildDrive(100, 0, 0, 1);
  drive.positions[90] = drive.positions[10];
  EXPECT_EQ(NumPlaces(FindPlaces(drive.graph, drive.positions)), 100);
  drive.graph.edges[ImagePair(10, 90)] = 50.0;
  const auto places = FindPlaces(drive.graph, drive.positions);
  EXPECT_EQ(NumPlaces(places), 99);
  EXPECT_EQ(places.at(90), 10);
}

TEST(Places, ImagesWithoutPositionAreOneEach) {
  Drive drive = BuildDrive(60, 20, 39, 1);
  drive.positions.erase(30);
  const auto places = FindPlaces(drive.graph, drive.positions);
  EXPECT_EQ(places.at(30), 30);
  EXPECT_EQ(places.at(31), 20);
  EXPECT_EQ(NumPlaces(FindPlaces(drive.graph, {})), 60);
}

TEST(Places, EdgesBetweenPlacesAddUp) {
  const Drive drive = BuildDrive(60, 20, 39, 1);
  const auto place_of_image = FindPlaces(drive.graph, drive.positions);
  const ImageGraph places = MergePlaces(drive.graph, place_of_image);
  EXPECT_EQ(places.images.size(), 41);
  double expected = 0.0;
  for (const auto& [pair, weight] : drive.graph.edges) {
    const bool is_at_rest1 = pair.image_id1 >= 20 && pair.image_id1 <= 39;
    const bool is_at_rest2 = pair.image_id2 >= 20 && pair.image_id2 <= 39;
    if (!(is_at_rest1 && is_at_rest2)) expected += weight;
  }
  double sum = 0.0;
  for (const auto& [pair, weight] : places.edges) sum += weight;
  EXPECT_NEAR(sum, expected, 1e-9);
  // Images 40 to 47 reach back to 39; 39 is in place 20.
  double to_next = 0.0;
  for (image_t i = 32; i <= 39; ++i) to_next += 100.0 / (40 - i);
  EXPECT_NEAR(places.edges.at(ImagePair(20, 40)), to_next, 1e-9);
}

}  // namespace
}  // namespace adasfm
