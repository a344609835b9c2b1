// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/global_stage_run.h"
#include "tests/testing/colmap_ext/inertial_drive.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

constexpr double kAccelerometerNoise = 0.02;  // m/s^2 sqrt(s)
constexpr int kNumImages = 200;
constexpr int kNumDarkImages = 10;
constexpr size_t kNumKeptMatches = 16;
constexpr size_t kNumPoints = 4;

// A drive with a gyroscope and 10 images that see nothing.
class GlobalStageGapsTest : public testing::TestWithParam<uint64_t> {
 protected:
  GlobalStageGapsTest() : world_(BuildSyntheticWorld(World())) {
    scene_ = BuildSyntheticScene(world_, {});
    for (RelativePosePrior& prior : scene_.priors) {
      prior.flags = kPriorRotation;
      prior.cam2_from_cam1.translation.setZero();
      prior.covariance.bottomRows<3>().setZero();
      prior.covariance.rightCols<3>().setZero();
      prior.covariance.diagonal().tail<3>().setConstant(
          std::numeric_limits<double>::infinity());
    }
    for (const SyntheticImage& image : world_.images) {
      poses_[image.image_id] = image.cam_from_world;
    }
  }

  static SyntheticWorldOptions World() {
    SyntheticWorldOptions options;
    options.num_images = kNumImages;
    options.num_blackouts = 1;
    options.blackout_num_images = kNumDarkImages;
    options.seed = GetParam();
    return options;
  }

  void AddInertialMotions() {
    std::vector<TimedPose> images;
    for (const SyntheticImage& image : world_.images) {
      images.push_back(
          {image.image_id, image.timestamp_ns, image.cam_from_world});
    }
    InertialDriveOptions options;
    options.noise = kAccelerometerNoise;
    options.bias = Eigen::Vector3d(0.05, -0.1, 0.08);
    options.lever = Eigen::Vector3d(0.1, 0.2, -0.3);
    options.seed = GetParam();
    scene_.inertial_motions = IntegrateDrive(std::move(images), options);
  }

  // Only pairs with later images constrain this image, nearly all by matches
  // that no third image has: it has a position, but next to no points.
  void TakePoints(image_t image_id) {
    std::map<image_t, std::set<uint32_t>> seen_in_no_other;
    std::set<uint32_t> used;
    for (ScenePair& pair : scene_.pairs) {
      if (pair.image_id1 != image_id && pair.image_id2 != image_id) continue;
      std::vector<FeatureMatch> kept;
      if (pair.image_id1 == image_id) {
        for (const FeatureMatch& match : pair.inlier_matches) {
          if (kept.size() == kNumKeptMatches) break;
          if (!used.insert(match.point2D_idx1).second) continue;
          kept.push_back(match);
          if (used.size() <= kNumPoints) continue;
          seen_in_no_other[pair.image_id2].insert(match.point2D_idx2);
        }
      }
      pair.inlier_matches = std::move(kept);
    }
    for (ScenePair& pair : scene_.pairs) {
      if (pair.image_id1 == image_id || pair.image_id2 == image_id) continue;
      auto& matches = pair.inlier_matches;
      matches.erase(
          std::remove_if(matches.begin(), matches.end(),
                         [&](const FeatureMatch& match) {
                           return seen_in_no_other[pair.image_id1].count(
                                      match.point2D_idx1) ||
                                  seen_in_no_other[pair.image_id2].count(
                                      match.point2D_idx2);
                         }),
          matches.end());
    }
    scene_.pairs.erase(std::remove_if(scene_.pairs.begin(), scene_.pairs.end(),
                                      [](const ScenePair& pair) {
                                        return pair.inlier_matches.empty();
                                      }),
                       scene_.pairs.end());
  }

  static Rigid3d Motion(const std::map<image_t, Rigid3d>& poses,
                        image_t image_id1, image_t image_id2) {
    return poses.at(image_id2) * poses.at(image_id1).Inverse();
  }

  static Eigen::Vector3d Error(const std::map<image_t, Rigid3d>& true_poses,
                               const MeasuredTranslation& measured,
                               const InertialLength& length) {
    return measured.translation -
           Motion(true_poses, length.image_id1, length.image_id2).translation;
  }

  const SyntheticWorld world_;
  SceneData scene_;
  std::map<image_t, Rigid3d> poses_;
};

TEST_P(GlobalStageGapsTest, TheGyroscopeAloneLeavesThemOpen) {
  const GlobalStageResult result = RunStage(scene_);
  EXPECT_LE(result.models[0].reconstruction.NumRegImages(),
            kNumImages - kNumDarkImages);
  EXPECT_TRUE(result.bridges.empty());
}

TEST_P(GlobalStageGapsTest, TheAccelerometerLeadsAcross) {
  AddInertialMotions();
  const GlobalStageResult result = RunStage(scene_);
  ASSERT_EQ(result.models.size(), 1);
  const CoarseModel& model = result.models[0];
  EXPECT_EQ(model.reconstruction.NumRegImages(), kNumImages);
  EXPECT_TRUE(model.metric);
  ASSERT_GT(model.inertial_scale_sigma, 0.0);
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(model.reconstruction);
  EXPECT_NEAR(ComputeAlignedErrors(poses, poses_, {}).scale, 1.0,
              3.0 * model.inertial_scale_sigma);

  // The bridges for the mapper.
  ASSERT_EQ(result.bridges.size(), kNumDarkImages + 1);
  size_t num_bridges = 0;
  double variance = 0.0;
  std::set<image_t> dark;
  for (const InertialLength& length : result.inertial_lengths) {
    if (!length.bridge) continue;
    ++num_bridges;
    const double step_variance = length.bridge->covariance.trace();
    EXPECT_LT(Error(poses_, *length.bridge, length).norm(),
              4.0 * std::sqrt(step_variance));
    variance += step_variance;
    dark.insert(length.image_id1);
    dark.insert(length.image_id2);
  }
  EXPECT_EQ(num_bridges, result.bridges.size());
  // The translation across the gap, between the images that see something.
  const Eigen::Vector3d error =
      Motion(poses, *dark.begin(), *dark.rbegin()).translation -
      Motion(poses_, *dark.begin(), *dark.rbegin()).translation;
  EXPECT_LT(error.norm(), 4.0 * std::sqrt(variance));
  EXPECT_LT(variance, 0.15 * 0.15);
}

// Otherwise the step to this image alone would connect the sides of the gap.
TEST_P(GlobalStageGapsTest, AnImageOnFewPointsBelongsToTheGap) {
  AddInertialMotions();
  std::set<image_t> dark;
  for (const auto& [image_id, image] : scene_.images) dark.insert(image_id);
  for (const ScenePair& pair : scene_.pairs) {
    dark.erase(pair.image_id1);
    dark.erase(pair.image_id2);
  }
  ASSERT_EQ(dark.size(), kNumDarkImages);
  const image_t next = *dark.rbegin() + 1;
  TakePoints(next);
  const GlobalStageResult result = RunStage(scene_);
  EXPECT_EQ(result.models[0].reconstruction.NumRegImages(), kNumImages);
  EXPECT_LE(result.models[0].reconstruction.Image(next).NumPoints3D(),
            kNumPoints);
  EXPECT_EQ(result.bridges.size(), kNumDarkImages + 2);
  EXPECT_EQ(result.bridges.count(ImagePair(next, next + 1)), 1);
}

// A largest model of num_images images, from num_kept_pairs of 100 visual pairs
// and all 50 sensor motions.
GlobalStageResult ResultOf(image_t num_images, int num_kept_pairs) {
  GlobalStageResult result;
  result.models.resize(2);
  for (image_t image_id = 1; image_id <= num_images; ++image_id) {
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetName(std::to_string(image_id));
    result.models[1].reconstruction.AddImage(image);
    result.models[1].reconstruction.RegisterImage(image_id);
  }
  result.poses.graph.edges.resize(150);
  for (int k = 0; k < 150; ++k) {
    ViewGraphEdge& edge = result.poses.graph.edges[k];
    if (k >= 100) {
      edge.source = EdgeSource::kSensor;
    } else if (k >= num_kept_pairs) {
      edge.removal = EdgeRemoval::kTranslation;
    }
  }
  return result;
}

TEST(IsBetterAcrossGaps, AsksForMoreImagesAndMostPairs) {
  const GlobalStageResult in_parts = ResultOf(30, 80);
  EXPECT_TRUE(IsBetterAcrossGaps(in_parts, ResultOf(40, 85)));
  EXPECT_TRUE(IsBetterAcrossGaps(in_parts, ResultOf(40, 73)));
  EXPECT_FALSE(IsBetterAcrossGaps(in_parts, ResultOf(40, 70)));
  EXPECT_FALSE(IsBetterAcrossGaps(in_parts, ResultOf(30, 85)));
}

INSTANTIATE_TEST_SUITE_P(Seeds, GlobalStageGapsTest, testing::Values(1, 2, 3));

}  // namespace
}  // namespace adasfm
