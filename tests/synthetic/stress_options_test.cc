// SPDX-License-Identifier: BSD-3-Clause
// Compares each option of a hard world with the world's properties, counted
// from its poses and matches.

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/so3.h"
#include "synthetic/synthetic_world.h"
#include "synthetic/traffic.h"
#include "synthetic/two_view_refinement.h"
#include "synthetic/world_summary.h"
#include "tests/testing/synthetic/world_properties.h"

namespace adasfm {
namespace {

Eigen::Vector3d Forward(const SyntheticImage& image) {
  return image.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

TEST(StressOptions, AliasRatioIsReachedOrRefused) {
  SyntheticWorldOptions options;
  options.num_images = 200;
  for (const double ratio : {0.1, 0.2, 0.4}) {
    options.alias_pair_ratio = ratio;
    const SyntheticWorldSummary summary =
        SummarizeWorld(BuildSyntheticWorld(options));
    EXPECT_NEAR(summary.alias_pair_ratio, ratio, 1.0 / summary.num_pairs);
  }
  options.alias_pair_ratio = 0.8;
  const std::string error = BuildError(options);
  const std::string phrase = "largest possible value of this drive is ";
  ASSERT_NE(error.find(phrase), std::string::npos) << error;
  const double largest =
      std::stod(error.substr(error.find(phrase) + phrase.size()));
  EXPECT_GT(largest, 0.4);
  options.alias_pair_ratio = largest - 0.01;
  EXPECT_EQ(BuildError(options), "");
}

TEST(StressOptions, OutlierRatioIsReached) {
  SyntheticWorldOptions options;
  options.num_images = 60;
  for (const double ratio : {0.1, 0.5, 0.8}) {
    options.outlier_match_ratio = ratio;
    const SyntheticWorldSummary summary =
        SummarizeWorld(BuildSyntheticWorld(options));
    // Wrong matches that join one landmark by chance count as right.
    EXPECT_NEAR(summary.outlier_match_ratio, ratio, 0.01);
  }
}

TEST(StressOptions, SummaryCountsBlackoutsAndOverlap) {
  SyntheticWorldOptions options;
  options.num_images = 120;
  options.num_blackouts = 2;
  options.blackout_num_images = 12;
  EXPECT_EQ(
      SummarizeWorld(BuildSyntheticWorld(options)).num_images_without_texture,
      24);
  options.blackout_num_keypoints = 14;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  int num_poor = 0;
  for (const SyntheticImage& image : world.images) {
    num_poor += image.keypoints.size() == 14;
  }
  EXPECT_EQ(num_poor, 24);
  options.num_blackouts = 0;
  const double near = SummarizeWorld(BuildSyntheticWorld(options)).mean_overlap;
  options.spacing_m = 6.0;
  const double far = SummarizeWorld(BuildSyntheticWorld(options)).mean_overlap;
  EXPECT_GT(near, far + 0.1);
  options.spacing_m = 1.5;
  options.num_blackouts = 6;
  EXPECT_NE(BuildError(options).find("at most 5"), std::string::npos);
}

TEST(StressOptions, LanesLieSideBySideAndSeeEachOther) {
  for (const double spacing_m : {1.0, 2.0}) {
    SyntheticWorldOptions options;
    options.num_images = 300;
    options.spacing_m = 0.5;
    options.image_interval_s = 0.5;
    options.trajectory = SyntheticTrajectory::kLanes;
    options.lane_spacing_m = spacing_m;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    std::set<int> lanes;
    int num_turning = 0;
    for (const SyntheticImage& image : world.images) {
      const Eigen::Vector3d forward = Forward(image);
      if (std::abs(forward.x()) < 0.99) {
        ++num_turning;
        continue;
      }
      const Eigen::Vector3d center = Center(image);
      if (center.x() < 0.5 || center.x() > options.lane_length_m - 0.5) {
        continue;
      }
      // The camera sits beside the path, the machine weaves by centimetres.
      const double lane = center.y() / spacing_m;
      EXPECT_NEAR(lane, std::round(lane), 0.2 / spacing_m);
      // Neighbouring lanes have opposite directions.
      EXPECT_EQ(forward.x() > 0.0, std::lround(lane) % 2 == 0);
      lanes.insert(std::lround(lane));
    }
    EXPECT_GE(lanes.size(), 6);
    EXPECT_GT(num_turning, 10);
    const SyntheticWorldSummary summary = SummarizeWorld(world);
    EXPECT_NEAR(summary.driven_m, 150.0, 10.0);
    EXPECT_GT(summary.num_revisit_pairs, 500);
  }
}

TEST(StressOptions, ParallelStreetsAreAliasedAllAlong) {
  SyntheticWorldOptions options;
  options.num_images = 300;
  options.trajectory = SyntheticTrajectory::kParallel;
  options.alias_pair_ratio = 0.2;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  std::set<image_t> in_second;
  for (const SyntheticPair& pair : world.pairs) {
    if (!pair.is_alias) continue;
    in_second.insert(pair.image_id2);
    const SyntheticImage& image1 = world.images[pair.image_id1 - 1];
    const SyntheticImage& image2 = world.images[pair.image_id2 - 1];
    EXPECT_GT((Center(image1) - Center(image2)).norm(), 45.0);
    EXPECT_GE(pair.inlier_matches.size(), 15);
  }
  EXPECT_GE(in_second.size(), 100);
  EXPECT_EQ(SummarizeWorld(world).num_revisit_pairs, 0);
}

TEST(StressOptions, FloorsLieAboveEachOtherAndLookAlike) {
  SyntheticWorldOptions options;
  options.num_images = 240;
  options.spacing_m = 3.0;
  options.trajectory = SyntheticTrajectory::kFloors;
  options.floor_height_m = 3.5;
  options.alias_pair_ratio = 0.2;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  int num_alias = 0;
  for (const SyntheticPair& pair : world.pairs) {
    const Eigen::Vector3d step = Center(world.images[pair.image_id2 - 1]) -
                                 Center(world.images[pair.image_id1 - 1]);
    if (!pair.is_alias) {
      EXPECT_LT(std::abs(step.z()), 1.75);
      continue;
    }
    ++num_alias;
    const double floors = step.z() / 3.5;
    EXPECT_NEAR(floors, std::round(floors), 0.15);
    EXPECT_GE(std::lround(floors), 1);
    EXPECT_LT(step.head<2>().norm(), 10.0);
  }
  EXPECT_NEAR(static_cast<double>(num_alias) / world.pairs.size(), 0.2, 0.01);
}

TEST(StressOptions, CarsCarryTheShareOfKeypointsAskedFor) {
  SyntheticWorldOptions options;
  options.num_images = 40;
  options.pixel_noise_px = 0.0;
  options.moving_keypoint_ratio = 0.6;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const SyntheticWorldSummary summary = SummarizeWorld(world);
  EXPECT_NEAR(summary.moving_keypoint_ratio, 0.6, 0.005);
  EXPECT_GT(summary.moving_match_ratio, 0.6);
  // A point on a car moves against the town, but not against the car.
  const SyntheticPair& pair = world.pairs.front();
  const SyntheticImage& image1 = world.images[pair.image_id1 - 1];
  const SyntheticImage& image2 = world.images[pair.image_id2 - 1];
  int num_on_cars = 0;
  for (const FeatureMatch& match : pair.inlier_matches) {
    const int point = image1.car_point_ids[match.point2D_idx1];
    if (point < 0 || image2.car_point_ids[match.point2D_idx2] != point) {
      continue;
    }
    ++num_on_cars;
    EXPECT_NE(image1.landmark_ids[match.point2D_idx1],
              image2.landmark_ids[match.point2D_idx2]);
    const int car = CarOfPoint(point);
    const Rigid3d cam2_from_cam1 =
        ComputeCam2FromCam1(image1.cam_from_car[car], image2.cam_from_car[car]);
    const Bearing bearing1 =
        ComputeBearing(world.camera, image1.keypoints[match.point2D_idx1]);
    const Bearing bearing2 =
        ComputeBearing(world.camera, image2.keypoints[match.point2D_idx2]);
    EXPECT_LT(ComputeSampsonErrorPx(bearing1, bearing2, cam2_from_cam1), 1e-3);
  }
  EXPECT_GT(num_on_cars, 50);
}

TEST(StressOptions, RollingShutterShiftsRowsByTheirTime) {
  SyntheticWorldOptions options;
  options.num_images = 60;
  options.pixel_noise_px = 0.0;
  const SyntheticWorld global = BuildSyntheticWorld(options);
  options.rolling_shutter_s = 0.02;
  const SyntheticWorld rolling = BuildSyntheticWorld(options);
  double middle = 0.0;
  double edge = 0.0;
  for (size_t i = 0; i < global.images.size(); ++i) {
    const SyntheticImage& a = global.images[i];
    const SyntheticImage& b = rolling.images[i];
    ASSERT_EQ(a.landmark_ids, b.landmark_ids);
    for (size_t k = 0; k < a.keypoints.size(); ++k) {
      const double share = a.keypoints[k].y() / options.image_height - 0.5;
      const double shift = (a.keypoints[k] - b.keypoints[k]).norm();
      double& largest = std::abs(share) < 0.02 ? middle : edge;
      largest = std::max(largest, shift);
    }
  }
  EXPECT_LT(middle, 0.05 * edge);
  EXPECT_GT(edge, 3.0);
}

TEST(StressOptions, SpuriousPairsFitAPoseAndJoinNothing) {
  SyntheticWorldOptions options;
  options.num_images = 120;
  options.spurious_pair_ratio = 0.5;
  options.alias_pair_ratio = 0.05;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const SyntheticWorldSummary summary = SummarizeWorld(world);
  EXPECT_NEAR(summary.spurious_pair_ratio, 0.5, 0.001);
  EXPECT_NEAR(summary.alias_pair_ratio, 0.05, 0.001);
  EXPECT_NEAR(summary.false_pair_ratio, 0.55, 0.002);
  for (const SyntheticPair& pair : world.pairs) {
    if (!pair.is_spurious) continue;
    EXPECT_GE(pair.inlier_matches.size(), 15);
    EXPECT_LE(pair.inlier_matches.size(), 25);
    int num_true = 0;
    const SyntheticImage& image1 = world.images[pair.image_id1 - 1];
    const SyntheticImage& image2 = world.images[pair.image_id2 - 1];
    for (const FeatureMatch& match : pair.inlier_matches) {
      num_true += image1.landmark_ids[match.point2D_idx1] ==
                  image2.landmark_ids[match.point2D_idx2];
      EXPECT_LE(ComputeSampsonErrorPx(
                    ComputeBearing(world.camera,
                                   image1.keypoints[match.point2D_idx1]),
                    ComputeBearing(world.camera,
                                   image2.keypoints[match.point2D_idx2]),
                    pair.cam2_from_cam1),
                4.0);
    }
    EXPECT_LT(num_true, 5);
  }
  options.num_images = 15;
  options.alias_pair_ratio = 0.0;
  options.spurious_pair_ratio = 0.9;
  EXPECT_NE(BuildError(options).find("largest possible value"),
            std::string::npos);
}

TEST(StressOptions, RotationOutliersAreWrongByTheirAngle) {
  SyntheticWorldOptions options;
  options.num_images = 60;
  options.rotation_outlier_ratio = 0.3;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  int num_wrong = 0;
  for (const SyntheticPair& pair : world.pairs) {
    const Rigid3d truth =
        ComputeCam2FromCam1(world.images[pair.image_id1 - 1].cam_from_world,
                            world.images[pair.image_id2 - 1].cam_from_world);
    const double error_deg =
        RadToDeg(AngleBetweenRad(pair.cam2_from_cam1.rotation, truth.rotation));
    EXPECT_EQ(error_deg > 12.0, pair.is_rotation_outlier);
    num_wrong += pair.is_rotation_outlier;
  }
  EXPECT_NEAR(static_cast<double>(num_wrong) / world.pairs.size(), 0.3, 0.001);
  EXPECT_NEAR(SummarizeWorld(world).rotation_outlier_ratio, 0.3, 0.001);
}

}  // namespace
}  // namespace adasfm
