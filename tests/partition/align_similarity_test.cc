// SPDX-License-Identifier: BSD-3-Clause
#include "partition/align_similarity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Cameras in the target world, metres: a drive around a block or a straight
// line.
std::vector<Rigid3d> BuildDrive(int num_images, bool straight) {
  std::vector<Rigid3d> cams_from_target;
  for (int i = 0; i < num_images; ++i) {
    const double angle = straight ? 0.3 : 2.0 * kPi * i / num_images;
    const Eigen::Vector3d center =
        straight ? Eigen::Vector3d(1.5 * i * std::cos(angle),
                                   1.5 * i * std::sin(angle), 0.0)
                 : Eigen::Vector3d(40.0 * std::cos(angle),
                                   25.0 * std::sin(angle), 0.0);
    cams_from_target.push_back(CamFromWorldWithCenter(
        ExpSo3(Eigen::Vector3d(0.1, 0.2, angle)), center));
  }
  return cams_from_target;
}

struct Noise {
  double center_m = 0.0;
  double rotation_rad = 0.0;
};

// The same cameras in the world of a part.
std::vector<PosePair> BuildPairs(const std::vector<Rigid3d>& cams_from_target,
                                 const Sim3d& source_from_target,
                                 const Noise& noise, Random* random) {
  std::vector<PosePair> poses;
  for (const Rigid3d& cam_from_target : cams_from_target) {
    const Rigid3d noisy = CamFromWorldWithCenter(
        ExpSo3(random->GaussianVector(noise.rotation_rad)) *
            cam_from_target.rotation,
        cam_from_target.TargetOriginInSource() +
            random->GaussianVector(noise.center_m));
    poses.push_back(
        {TransformCamFromWorld(source_from_target, noisy), cam_from_target});
  }
  return poses;
}

Sim3d RandomSimilarity(Random* random) {
  return Sim3d(random->Uniform(0.2, 5.0),
               ExpSo3(random->UnitVector() * random->Uniform(0.0, 3.0)),
               random->GaussianVector(50.0));
}

TEST(AlignSimilarity, ExactWithoutNoise) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (const bool straight : {false, true}) {
      Random random(seed);
      const Sim3d source_from_target = RandomSimilarity(&random);
      const auto poses =
          BuildPairs(BuildDrive(60, straight), source_from_target, {}, &random);
      const AlignSimilarityResult result = AlignSimilarity({}, poses);
      ASSERT_TRUE(result.success);
      const Sim3d identity = result.target_from_source * source_from_target;
      EXPECT_NEAR(identity.scale, 1.0, 1e-9);
      EXPECT_LT(LogSo3(identity.rotation).norm(), 1e-8);
      EXPECT_LT(identity.translation.norm(), 1e-7);
      EXPECT_EQ(result.inlier_ratio, 1.0);
      // All poses fit at every threshold: the lowest one is final.
      EXPECT_NEAR(result.threshold, kMinAlignmentThreshold, 1e-9);
    }
  }
}

// On a straight road the centres leave the roll about the line open; the
// orientations must fix it to their own accuracy.
TEST(AlignSimilarity, StraightRoadTakesTheRollFromOrientations) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const Noise noise = {0.05, DegToRad(1.0)};
    const int num_images = 60;
    const Sim3d source_from_target = RandomSimilarity(&random);
    const auto poses = BuildPairs(BuildDrive(num_images, true),
                                  source_from_target, noise, &random);
    const AlignSimilarityResult result = AlignSimilarity({}, poses);
    ASSERT_TRUE(result.success);
    const Sim3d identity = result.target_from_source * source_from_target;
    EXPECT_LT(LogSo3(identity.rotation).norm(),
              5.0 * noise.rotation_rad / std::sqrt(1.0 * num_images));
  }
}

TEST(AlignSimilarity, OutliersDoNotMoveTheResult) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const Noise noise = {0.05, DegToRad(0.5)};
    const int num_images = 80;
    const Sim3d source_from_target = RandomSimilarity(&random);
    auto poses = BuildPairs(BuildDrive(num_images, false), source_from_target,
                            noise, &random);
    std::vector<char> is_outlier(num_images, 0);
    for (const int i : random.Sample(num_images / 5, num_images)) {
      is_outlier[i] = 1;
      poses[i].cam_from_target.translation += random.UnitVector() * 20.0;
    }
    const AlignSimilarityResult result = AlignSimilarity({}, poses);
    ASSERT_TRUE(result.success);
    double sum_squares = 0.0;
    for (int i = 0; i < num_images; ++i) {
      EXPECT_FALSE(is_outlier[i] && result.inlier_mask[i]);
      if (is_outlier[i]) continue;
      const Eigen::Vector3d error =
          result.target_from_source *
              poses[i].cam_from_source.TargetOriginInSource() -
          poses[i].cam_from_target.TargetOriginInSource();
      sum_squares += error.squaredNorm();
    }
    EXPECT_LT(std::sqrt(sum_squares / (0.8 * num_images)),
              1.2 * std::sqrt(3.0) * noise.center_m);
  }
}

// A wrong turn in the middle: the second half is bent away by 40 degrees.
TEST(AlignSimilarity, BentPartDoesNotFit) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    auto poses =
        BuildPairs(BuildDrive(80, true), Sim3d(), {0.05, 0.005}, &random);
    const Eigen::Vector3d hinge =
        poses[40].cam_from_source.TargetOriginInSource();
    const Eigen::Quaterniond turn =
        ExpSo3(Eigen::Vector3d(0.0, 0.0, DegToRad(40.0)));
    const Sim3d bend(1.0, turn, hinge - turn * hinge);
    for (int i = 40; i < 80; ++i) {
      poses[i].cam_from_source =
          TransformCamFromWorld(bend, poses[i].cam_from_source);
    }
    const AlignSimilarityResult result = AlignSimilarity({}, poses);
    EXPECT_FALSE(result.success);
    EXPECT_LT(result.inlier_ratio, AlignSimilarityOptions().min_inlier_ratio);
  }
}

TEST(AlignSimilarity, ThresholdRisesOnlyAsFarAsNeeded) {
  Random random(7);
  const auto poses = BuildPairs(BuildDrive(100, false), Sim3d(),
                                {1.0, DegToRad(0.5)}, &random);
  AlignSimilarityOptions options;
  const AlignSimilarityResult adaptive = AlignSimilarity(options, poses);
  EXPECT_TRUE(adaptive.success);
  EXPECT_GT(adaptive.threshold, options.initial_threshold);
  EXPECT_GT(adaptive.num_iterations, 1);
  // No fit without adaptation.
  options.adapt_threshold = false;
  EXPECT_FALSE(AlignSimilarity(options, poses).success);
  // The unit scales the threshold.
  options = {};
  options.unit = 2.0;
  const AlignSimilarityResult scaled = AlignSimilarity(options, poses);
  EXPECT_TRUE(scaled.success);
  EXPECT_GE(scaled.inlier_ratio, options.min_inlier_ratio);
}

// A short part would fit anywhere within a threshold of its own size. These ten
// images stand on 13.5 m.
TEST(AlignSimilarity, TheThresholdIsSmallAgainstTheExtent) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const AlignSimilarityResult result =
        AlignSimilarity({}, BuildPairs(BuildDrive(10, true), Sim3d(),
                                       {5.0, DegToRad(0.5)}, &random));
    EXPECT_LE(result.threshold, 1.35) << "seed " << seed;
    EXPECT_FALSE(result.success) << "seed " << seed;
  }
}

TEST(AlignSimilarity, WrongOrientationsAreNoInliers) {
  Random random(3);
  auto poses = BuildPairs(BuildDrive(50, false), Sim3d(), {}, &random);
  EXPECT_TRUE(AlignSimilarity({}, poses).success);
  for (int i = 0; i < 25; ++i) {
    poses[2 * i].cam_from_source = CamFromWorldWithCenter(
        ExpSo3(random.UnitVector() * 1.0) *
            poses[2 * i].cam_from_source.rotation,
        poses[2 * i].cam_from_source.TargetOriginInSource());
  }
  EXPECT_FALSE(AlignSimilarity({}, poses).success);
}

TEST(AlignSimilarity, TooFewOrCoincidingCentresFail) {
  Random random(1);
  EXPECT_FALSE(AlignSimilarity({}, {}).success);
  auto poses = BuildPairs(BuildDrive(2, false), Sim3d(), {}, &random);
  EXPECT_FALSE(AlignSimilarity({}, poses).success);
  const std::vector<Rigid3d> standing(10);
  poses = BuildPairs(standing, Sim3d(), {}, &random);
  EXPECT_FALSE(AlignSimilarity({}, poses).success);
}

TEST(AlignSimilarity, WrongOptionsAreNamed) {
  AlignSimilarityOptions options;
  options.max_inlier_ratio = 0.5;
  std::string error;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("max_inlier_ratio = 0.5"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
