// SPDX-License-Identifier: BSD-3-Clause
// Compares each option of a hard world with the world's properties, counted
// from its poses, logs and matches.

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/so3.h"
#include "synthetic/sensor_logs.h"
#include "synthetic/street_grid.h"
#include "synthetic/synthetic_world.h"
#include "synthetic/traffic.h"
#include "synthetic/two_view_refinement.h"
#include "synthetic/world_summary.h"

namespace adasfm {
namespace {

Eigen::Vector3d Center(const SyntheticImage& image) {
  return image.cam_from_world.TargetOriginInSource();
}

Eigen::Vector3d Forward(const SyntheticImage& image) {
  return image.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

// The message of the error that these options cause; empty without an error.
std::string BuildError(const SyntheticWorldOptions& options) {
  try {
    BuildSyntheticWorld(options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
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

SyntheticWorldOptions NoiseFreeOptions() {
  SyntheticWorldOptions options;
  options.num_keypoints_per_image = 20;
  options.imu_noise = {0.0, 0.0, 0.0, 0.0};
  options.gyro_bias_sigma = 0.0;
  options.accel_bias_sigma = 0.0;
  options.wheel_speed_noise = 0.0;
  return options;
}

TEST(StressOptions, StopsAndSpinsStandInLogsAndPoses) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 200;
  options.spacing_m = 3.0;
  options.num_stops = 1;
  options.stop_duration_s = 6.0;
  options.num_spins = 1;
  options.spin_duration_s = 5.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  ASSERT_EQ(world.stops.size(), 2);
  EXPECT_NEAR(SummarizeWorld(world).standing_s, 11.0, 1e-6);
  int num_spins = 0;
  for (const auto& [begin, end] : world.stops) {
    double turned = 0.0;
    for (const ImuSample& sample : world.imu_samples) {
      if (sample.timestamp_ns < begin || sample.timestamp_ns > end) continue;
      turned += sample.angular_velocity.z() / options.imu_rate_hz;
    }
    const bool is_spin = std::abs(turned) > 1.0;
    num_spins += is_spin;
    EXPECT_NEAR(std::abs(turned), is_spin ? 2.0 * kPi : 0.0, 0.02);
    double rolled = 0.0;
    for (const WheelSample& sample : world.wheel_samples) {
      if (sample.timestamp_ns < begin || sample.timestamp_ns > end) continue;
      rolled = std::max(rolled, std::abs(sample.first + sample.second));
    }
    EXPECT_LT(rolled, 1e-9);
    const SyntheticImage* last = nullptr;
    for (const SyntheticImage& image : world.images) {
      if (image.timestamp_ns < begin || image.timestamp_ns > end) continue;
      if (last != nullptr && !is_spin) {
        EXPECT_LT((Center(image) - Center(*last)).norm(), 1e-9);
      }
      last = &image;
    }
    ASSERT_NE(last, nullptr);
  }
  EXPECT_EQ(num_spins, 1);
  options.stop_duration_s = 500.0;
  EXPECT_NE(BuildError(options).find("at most"), std::string::npos);
}

// An hour at rest with an image every six minutes, in the middle of a drive
// whose other images are those of a shorter drive without a stop.
TEST(StressOptions, AStopMayLastForHours) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 30;
  const SyntheticWorld without = BuildSyntheticWorld(options);
  options.num_images = 40;
  options.imu_rate_hz = 20.0;
  options.num_stops = 1;
  options.stop_duration_s = 3600.0;
  options.stop_image_interval_s = 360.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  EXPECT_NEAR(SummarizeWorld(world).standing_s, 3600.0, 1e-6);
  ASSERT_EQ(world.images.size(), 40);
  ASSERT_EQ(world.stops.size(), 1);
  std::vector<Eigen::Vector3d> at_rest, under_way;
  for (const SyntheticImage& image : world.images) {
    const bool is_at_rest = image.timestamp_ns >= world.stops[0].first &&
                            image.timestamp_ns <= world.stops[0].second;
    (is_at_rest ? at_rest : under_way).push_back(Center(image));
  }
  ASSERT_EQ(at_rest.size(), 10);
  for (const Eigen::Vector3d& center : at_rest) {
    EXPECT_LT((center - at_rest.front()).norm(), 1e-9);
  }
  // The jitter of the times moves an image by 1 % of a spacing.
  for (size_t i = 0; i < under_way.size(); ++i) {
    EXPECT_LT((under_way[i] - Center(without.images[i])).norm(),
              0.05 * options.spacing_m);
  }
  double turned = 0.0;
  for (const ImuSample& sample : world.imu_samples) {
    if (sample.timestamp_ns < world.stops[0].first ||
        sample.timestamp_ns > world.stops[0].second) {
      continue;
    }
    turned += sample.angular_velocity.norm();
  }
  EXPECT_LT(turned, 1e-6);
  options.stop_image_interval_s = 60.0;
  EXPECT_NE(BuildError(options).find("at most 20"), std::string::npos);
  options.num_stops = 0;
  EXPECT_NE(BuildError(options).find("without stops"), std::string::npos);
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

TEST(StressOptions, GravelSlipsHaveTheirSigma) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 600;
  options.spacing_m = 4.0;
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.wheel_slip_sigma = 0.1;
  const SyntheticWorld gravel = BuildSyntheticWorld(options);
  double sum = 0.0;
  double product = 0.0;
  int num = 0;
  for (size_t i = 0; i < clean.wheel_samples.size(); ++i) {
    if (std::abs(clean.wheel_samples[i].first) < 0.5) continue;
    const double left =
        gravel.wheel_samples[i].first / clean.wheel_samples[i].first - 1.0;
    const double right =
        gravel.wheel_samples[i].second / clean.wheel_samples[i].second - 1.0;
    sum += left * left + right * right;
    product += left * right;
    num += 2;
  }
  // 300 s of a correlation time of 1 s and two wheels: some 300 draws.
  EXPECT_NEAR(std::sqrt(sum / num), 0.1, 0.1 * 4.0 / std::sqrt(2.0 * 300.0));
  EXPECT_LT(std::abs(product / num), 0.2 * 0.01);
}

TEST(StressOptions, GyroscopeDriftsAsAskedFor) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.gyro_drift = 2e-4;
  const SyntheticWorld drifting = BuildSyntheticWorld(options);
  const size_t last = clean.imu_samples.size() - 1;
  const Eigen::Vector3d bias = drifting.imu_samples[last].angular_velocity -
                               clean.imu_samples[last].angular_velocity;
  EXPECT_NEAR(bias.z(), 2e-4 * last / options.imu_rate_hz, 1e-9);
  EXPECT_LT(bias.head<2>().norm(), 1e-12);
}

TEST(StressOptions, RatesOfTheGyroscopeAreScaled) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  const SyntheticWorld clean = BuildSyntheticWorld(options);
  options.gyro_scale = 0.02;
  const SyntheticWorld scaled = BuildSyntheticWorld(options);
  double largest = 0.0;
  for (size_t i = 0; i < clean.imu_samples.size(); ++i) {
    const Eigen::Vector3d rate =
        clean.imu_samples[i].angular_velocity - clean.true_gyro_bias;
    EXPECT_LT((scaled.imu_samples[i].angular_velocity -
               clean.imu_samples[i].angular_velocity - 0.02 * rate)
                  .norm(),
              1e-12);
    largest = std::max(largest, rate.norm());
  }
  EXPECT_GT(largest, 0.1);
}

TEST(StressOptions, FixesHaveNoiseAndJumps) {
  SyntheticWorldOptions options = NoiseFreeOptions();
  options.num_images = 600;
  EXPECT_TRUE(BuildSyntheticWorld(options).gnss_fixes.empty());
  options.gnss_rate_hz = 5.0;
  options.gnss_noise_m = 0.0;
  const SyntheticWorld exact = BuildSyntheticWorld(options);
  // The antenna's position at an image, from the camera's pose and calibration.
  const SyntheticImage& image = exact.images[100];
  const Eigen::Vector3d antenna =
      (exact.cam_from_imu.Inverse() * image.cam_from_world).Inverse() *
      exact.antenna_in_imu;
  double nearest = 1e9;
  for (const SyntheticFix& fix : exact.gnss_fixes) {
    if (std::abs(fix.timestamp_ns - image.timestamp_ns) > 110000000) continue;
    nearest = std::min(nearest, (fix.position_in_world - antenna).norm());
  }
  EXPECT_LT(nearest, 1.0);  // 8 m/s for 0.1 s
  options.gnss_noise_m = 0.7;
  options.num_gnss_jumps = 2;
  const SyntheticWorld noisy = BuildSyntheticWorld(options);
  double sum = 0.0;
  int num_jumping = 0;
  const size_t num = exact.gnss_fixes.size();
  for (size_t i = 0; i < num; ++i) {
    const Eigen::Vector3d error = noisy.gnss_fixes[i].position_in_world -
                                  exact.gnss_fixes[i].position_in_world;
    if (error.norm() > 8.0) {
      ++num_jumping;
      EXPECT_NEAR(error.norm(), 15.0, 5.0 * 0.7);
    } else {
      sum += error.squaredNorm();
    }
  }
  EXPECT_NEAR(num_jumping, 2 * 5 * 5, 2);
  const size_t num_noisy = 3 * (num - num_jumping);
  EXPECT_NEAR(std::sqrt(sum / num_noisy), 0.7,
              0.7 * 4.0 / std::sqrt(2.0 * num_noisy));
}

}  // namespace
}  // namespace adasfm
