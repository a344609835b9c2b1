// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/synthetic_world.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <set>

#include "core/so3.h"
#include "synthetic/street_grid.h"
#include "synthetic/two_view_refinement.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

const SyntheticImage& ImageOf(const SyntheticWorld& world, image_t image_id) {
  return world.images[image_id - 1];
}

int CountTrueMatches(const SyntheticWorld& world, const SyntheticPair& pair) {
  int num = 0;
  for (const FeatureMatch& match : pair.inlier_matches) {
    num += ImageOf(world, pair.image_id1).landmark_ids[match.point2D_idx1] ==
           ImageOf(world, pair.image_id2).landmark_ids[match.point2D_idx2];
  }
  return num;
}

Rigid3d TrueCam2FromCam1(const SyntheticWorld& world,
                         const SyntheticPair& pair) {
  return ComputeCam2FromCam1(ImageOf(world, pair.image_id1).cam_from_world,
                             ImageOf(world, pair.image_id2).cam_from_world);
}

TEST(BuildSyntheticWorld, ASecondCameraSeesTheSameFrames) {
  SyntheticWorldOptions options;
  options.num_images = 20;
  const SyntheticWorld one = BuildSyntheticWorld(options);
  options.stereo_baseline_m = 0.4;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  ASSERT_EQ(world.images.size(), 40);
  std::set<std::pair<int, int>> matched;  // cameras
  for (const SyntheticPair& pair : world.pairs) {
    const SyntheticImage& image1 = ImageOf(world, pair.image_id1);
    const SyntheticImage& image2 = ImageOf(world, pair.image_id2);
    matched.insert({image1.camera_index, image2.camera_index});
    EXPECT_GT(CountTrueMatches(world, pair), 0.8 * pair.inlier_matches.size());
  }
  EXPECT_EQ(matched, (std::set<std::pair<int, int>>{{0, 0}, {0, 1}, {1, 1}}));
  for (int i = 0; i < 20; ++i) {
    const SyntheticImage& left = world.images[i];
    const SyntheticImage& right = world.images[20 + i];
    // The first camera sees the same as without a second camera.
    EXPECT_EQ(left.name, "cam0/" + one.images[i].name);
    EXPECT_EQ(left.keypoints, one.images[i].keypoints);
    EXPECT_EQ(right.name, "cam1/" + one.images[i].name);
    EXPECT_EQ(right.timestamp_ns, left.timestamp_ns);
    EXPECT_TRUE(PosesNear(
        ComputeCam2FromCam1(left.cam_from_world, right.cam_from_world),
        world.cam1_from_cam0, 1e-9, 1e-9));
  }
  EXPECT_NEAR(world.cam1_from_cam0.TargetOriginInSource().x(), 0.4, 1e-12);
}

TEST(BuildSyntheticWorld, KeypointsAreProjectionsOfTheirLandmarks) {
  for (const auto model :
       {SyntheticCameraModel::kPinhole, SyntheticCameraModel::kFisheye}) {
    SyntheticWorldOptions options;
    options.camera_model = model;
    options.pixel_noise_px = 0.0;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    for (const SyntheticImage& image : world.images) {
      ASSERT_EQ(image.keypoints.size(), image.landmark_ids.size());
      EXPECT_LE(image.keypoints.size(), 300);
      EXPECT_GE(image.keypoints.size(), 100);
      const std::set<int> different(image.landmark_ids.begin(),
                                    image.landmark_ids.end());
      EXPECT_EQ(different.size(), image.landmark_ids.size());
      const Eigen::Vector3d center =
          image.cam_from_world.TargetOriginInSource();
      for (size_t k = 0; k < image.keypoints.size(); ++k) {
        const Eigen::Vector3d& landmark =
            world.landmarks[image.landmark_ids[k]];
        Eigen::Vector2d pixel;
        ASSERT_TRUE(ProjectPoint(world.camera, image.cam_from_world * landmark,
                                 &pixel));
        EXPECT_LT((pixel - image.keypoints[k]).norm(), 1e-9);
        EXPECT_LT((landmark - center).norm(), kMaxViewDistance);
        EXPECT_TRUE(HasLineOfSight(center.head<2>(), landmark.head<2>()));
      }
    }
  }
}

TEST(BuildSyntheticWorld, KeypointNoiseHasTheSigmaAskedFor) {
  SyntheticWorldOptions options;
  options.pixel_noise_px = 0.8;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  double sum = 0.0;
  int num = 0;
  for (const SyntheticImage& image : world.images) {
    for (size_t k = 0; k < image.keypoints.size(); ++k) {
      Eigen::Vector2d pixel;
      ProjectPoint(
          world.camera,
          image.cam_from_world * world.landmarks[image.landmark_ids[k]],
          &pixel);
      sum += (pixel - image.keypoints[k]).squaredNorm();
      num += 2;
    }
  }
  EXPECT_NEAR(std::sqrt(sum / num) / 0.8, 1.0, 4.0 / std::sqrt(2.0 * num));
}

TEST(BuildSyntheticWorld, ImagesAreEvenlySpacedInTime) {
  SyntheticWorldOptions options;
  options.num_images = 200;
  options.timeshift_cam_imu_s = 0.1;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  double length = 0.0;
  for (size_t i = 1; i < world.images.size(); ++i) {
    const SyntheticImage& image = world.images[i];
    EXPECT_EQ(image.image_id, i + 1);
    EXPECT_EQ(image.name, std::to_string(image.timestamp_ns) + ".png");
    EXPECT_GT(image.timestamp_ns, world.images[i - 1].timestamp_ns);
    EXPECT_LT(image.timestamp_ns - world.images[i - 1].timestamp_ns, 500000000);
    length += (image.cam_from_world.TargetOriginInSource() -
               world.images[i - 1].cam_from_world.TargetOriginInSource())
                  .norm();
  }
  EXPECT_NEAR(length / 199, options.spacing_m, 0.03 * options.spacing_m);
  // The logs cover all images.
  EXPECT_LT(world.imu_samples.front().timestamp_ns,
            world.images.front().timestamp_ns + 100000000);
  EXPECT_GT(world.imu_samples.back().timestamp_ns,
            world.images.back().timestamp_ns + 100000000);
  EXPECT_GT(world.wheel_samples.back().timestamp_ns,
            world.images.back().timestamp_ns + 100000000);
}

TEST(BuildSyntheticWorld, InliersSeeTheSameLandmark) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options;
    options.seed = seed;
    options.outlier_match_ratio = 0.3;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    size_t num_raw = 0;
    size_t num_inliers = 0;
    size_t num_true = 0;
    for (const SyntheticPair& pair : world.pairs) {
      EXPECT_LT(pair.image_id1, pair.image_id2);
      EXPECT_FALSE(pair.is_alias);
      EXPECT_GE(pair.inlier_matches.size(), 15);
      EXPECT_NEAR(pair.cam2_from_cam1.translation.norm(), 1.0, 1e-9);
      const std::set<FeatureMatch> raw(pair.raw_matches.begin(),
                                       pair.raw_matches.end());
      for (const FeatureMatch& match : pair.inlier_matches) {
        EXPECT_EQ(raw.count(match), 1);
      }
      num_raw += pair.raw_matches.size();
      num_inliers += pair.inlier_matches.size();
      num_true += CountTrueMatches(world, pair);
    }
    EXPECT_GT(num_true, 0.98 * num_inliers);
    EXPECT_NEAR(static_cast<double>(num_inliers) / num_raw, 0.7, 0.03);
  }
}

TEST(BuildSyntheticWorld, TwoViewPosesAreExactWithoutNoise) {
  SyntheticWorldOptions options;
  options.pixel_noise_px = 0.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  for (const SyntheticPair& pair : world.pairs) {
    const Rigid3d truth = TrueCam2FromCam1(world, pair);
    EXPECT_TRUE(
        RotationsNear(pair.cam2_from_cam1.rotation, truth.rotation, 1e-6));
    EXPECT_LT(
        AngleBetweenRad(pair.cam2_from_cam1.translation, truth.translation),
        1e-5);
  }
}

TEST(BuildSyntheticWorld, MorePixelNoiseMeansWorseTwoViewPoses) {
  const auto mean_errors = [](double pixel_noise_px) {
    SyntheticWorldOptions options;
    options.pixel_noise_px = pixel_noise_px;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    std::pair<double, double> sum(0.0, 0.0);
    for (const SyntheticPair& pair : world.pairs) {
      const Rigid3d truth = TrueCam2FromCam1(world, pair);
      sum.first += RadToDeg(
          AngleBetweenRad(pair.cam2_from_cam1.rotation, truth.rotation));
      sum.second += RadToDeg(
          AngleBetweenRad(pair.cam2_from_cam1.translation, truth.translation));
    }
    const double num = static_cast<double>(world.pairs.size());
    return std::make_pair(sum.first / num, sum.second / num);
  };
  const auto low = mean_errors(0.25);
  const auto high = mean_errors(1.0);
  // Linear in the noise, up to a factor of two either way.
  EXPECT_GT(high.first, 2.0 * low.first);
  EXPECT_GT(high.second, 2.0 * low.second);
  EXPECT_LT(high.first, 8.0 * low.first);
  EXPECT_LT(high.first, 0.5);
  EXPECT_LT(high.second, 3.0);
}

TEST(BuildSyntheticWorld, AliasPairsAreConsistentAndFarApart) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options;
    options.seed = seed;
    options.num_images = 300;
    options.alias_pair_ratio = 0.05;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    int num_alias = 0;
    for (const SyntheticPair& pair : world.pairs) {
      if (!pair.is_alias) continue;
      ++num_alias;
      const SyntheticImage& image1 = ImageOf(world, pair.image_id1);
      const SyntheticImage& image2 = ImageOf(world, pair.image_id2);
      EXPECT_GT((image1.cam_from_world.TargetOriginInSource() -
                 image2.cam_from_world.TargetOriginInSource())
                    .norm(),
                45.0);
      EXPECT_EQ(CountTrueMatches(world, pair), 0);
      // One small motion explains all matches.
      EXPECT_GE(pair.inlier_matches.size(), 15);
      EXPECT_LT(RadToDeg(AngleBetweenRad(pair.cam2_from_cam1.rotation,
                                         Eigen::Quaterniond::Identity())),
                45.0);
      for (const FeatureMatch& match : pair.inlier_matches) {
        const double error = ComputeSampsonErrorPx(
            ComputeBearing(world.camera, image1.keypoints[match.point2D_idx1]),
            ComputeBearing(world.camera, image2.keypoints[match.point2D_idx2]),
            pair.cam2_from_cam1);
        EXPECT_LE(error, 4.0 + 1e-9);
      }
    }
    EXPECT_NEAR(static_cast<double>(num_alias) / world.pairs.size(), 0.05,
                0.002);
  }
}

TEST(BuildSyntheticWorld, TownsComeBackToPlacesSeenBefore) {
  int num_with_revisits = 0;
  for (const uint64_t seed : {1, 2, 3, 4}) {
    SyntheticWorldOptions options;
    options.seed = seed;
    options.num_images = 500;
    options.num_sequential_neighbors = 3;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    int num_revisits = 0;
    for (const SyntheticPair& pair : world.pairs) {
      num_revisits += pair.image_id2 - pair.image_id1 > 30;
    }
    num_with_revisits += num_revisits > 50;
  }
  EXPECT_GE(num_with_revisits, 3);
}

TEST(BuildSyntheticWorld, StraightStreetHasCollinearCenters) {
  SyntheticWorldOptions options;
  options.trajectory = SyntheticTrajectory::kStraight;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const SyntheticImage& image : world.images) {
    mean += image.cam_from_world.TargetOriginInSource() / world.images.size();
  }
  for (const SyntheticImage& image : world.images) {
    const Eigen::Vector3d d =
        image.cam_from_world.TargetOriginInSource() - mean;
    covariance += d * d.transpose() / world.images.size();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  EXPECT_LT(std::sqrt(solver.eigenvalues()[1]), 0.005);
  EXPECT_GT(std::sqrt(solver.eigenvalues()[2]), 30.0);
}

TEST(BuildSyntheticWorld, BlackoutsAreRunsWithoutKeypoints) {
  SyntheticWorldOptions options;
  options.num_images = 120;
  options.num_blackouts = 2;
  options.blackout_num_images = 12;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  std::vector<int> runs;
  bool in_run = false;
  for (const SyntheticImage& image : world.images) {
    if (image.keypoints.empty()) {
      if (!in_run) runs.push_back(0);
      ++runs.back();
    }
    in_run = image.keypoints.empty();
  }
  EXPECT_EQ(runs, std::vector<int>({12, 12}));
}

TEST(BuildSyntheticWorld, NeighborsLimitTheSequentialPairs) {
  SyntheticWorldOptions options;
  options.num_images = 50;
  options.num_sequential_neighbors = 2;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  EXPECT_LE(world.pairs.size(), 49 + 48);
  for (const SyntheticPair& pair : world.pairs) {
    EXPECT_LE(pair.image_id2 - pair.image_id1, 2);
  }
}

TEST(BuildSyntheticWorld, EqualOptionsGiveEqualWorlds) {
  SyntheticWorldOptions options;
  options.num_images = 150;
  options.alias_pair_ratio = 0.05;
  options.num_wheel_slips = 1;
  const SyntheticWorld a = BuildSyntheticWorld(options);
  const SyntheticWorld b = BuildSyntheticWorld(options);
  ASSERT_EQ(a.pairs.size(), b.pairs.size());
  for (size_t i = 0; i < a.pairs.size(); ++i) {
    EXPECT_EQ(a.pairs[i].raw_matches, b.pairs[i].raw_matches);
    EXPECT_EQ(a.pairs[i].inlier_matches, b.pairs[i].inlier_matches);
    EXPECT_EQ(a.pairs[i].cam2_from_cam1.translation,
              b.pairs[i].cam2_from_cam1.translation);
  }
  for (size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(a.images[i].keypoints, b.images[i].keypoints);
  }
  EXPECT_EQ(a.imu_samples.back().specific_force,
            b.imu_samples.back().specific_force);
  EXPECT_EQ(a.wheel_samples.back().first, b.wheel_samples.back().first);
  options.seed = 2;
  const SyntheticWorld c = BuildSyntheticWorld(options);
  EXPECT_NE(a.images[0].keypoints, c.images[0].keypoints);
}

TEST(BuildSyntheticWorld, ImageIntervalSetsTheSpeed) {
  for (const double interval_s : {0.1, 1.0}) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.spacing_m = 0.6;
    options.trajectory = SyntheticTrajectory::kStraight;
    options.image_interval_s = interval_s;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const size_t middle = world.images.size() / 2;
    EXPECT_NEAR(SecondsFromNs(world.images.back().timestamp_ns -
                              world.images[middle].timestamp_ns) /
                    (world.images.size() - 1 - middle),
                interval_s, 0.1 * interval_s);
  }
}

TEST(BuildSyntheticWorld, RejectsImpossibleOptions) {
  SyntheticWorldOptions options;
  std::string error;
  EXPECT_TRUE(options.IsValid(&error));
  options.num_blackouts = 7;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("num_blackouts = 7"), std::string::npos);
  EXPECT_THROW(BuildSyntheticWorld(options), std::invalid_argument);
  options = SyntheticWorldOptions();
  options.spacing_m = -1.0;
  EXPECT_THROW(BuildSyntheticWorld(options), std::invalid_argument);
  // Aliased places have to be far from each other.
  options = SyntheticWorldOptions();
  options.num_images = 30;
  options.alias_pair_ratio = 0.1;
  EXPECT_THROW(BuildSyntheticWorld(options), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
