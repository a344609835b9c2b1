// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/local_mapper.h"

#include <gtest/gtest.h>

#include <cmath>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/part_adjuster.h"
#include "colmap_ext/mapper/prior_support.h"
#include "colmap_ext/mapper/register_image.h"
#include "tests/testing/colmap_ext/mapper_world.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

std::set<image_t> AllImages(const MapperWorld& world) {
  std::set<image_t> images;
  for (const auto& [image_id, image] : world.data.images) {
    images.insert(image_id);
  }
  return images;
}

MapperWorldOptions SmallWorld(uint64_t seed) {
  MapperWorldOptions options;
  options.world.num_images = 30;
  options.world.seed = seed;
  return options;
}

TEST(InitialPair, HasTheParallaxAskedFor) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildMapperWorld(SmallWorld(seed));
    const auto scene =
        BuildMapperScene(world.data, world.coarse_poses, AllImages(world));
    const auto pairs = FindInitialPairs(4.0, *scene, 3);
    ASSERT_FALSE(pairs.empty());
    EXPECT_LE(pairs.size(), 3);
    for (size_t i = 0; i < pairs.size(); ++i) {
      EXPECT_GE(pairs[i].num_points, kMinNumInitialMatches);
      if (i > 0) {
        EXPECT_LE(pairs[i].num_points, pairs[i - 1].num_points);
      }
    }
    // If the poses explain no matches, there are no pairs.
    EXPECT_TRUE(FindInitialPairs(1e-9, *scene, 3).empty());
  }
}

// P_gb, computed from registered images in another frame, is the true pose in
// that frame if the coarse motions are true.
TEST(GlobalCandidate, FollowsTheLocalFrame) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    MapperWorldOptions options = SmallWorld(seed);
    options.center_sigma_m = 0.0;
    options.rotation_sigma_rad = 0.0;
    const MapperWorld world = BuildMapperWorld(options);
    const auto scene =
        BuildMapperScene(world.data, world.coarse_poses, AllImages(world));
    Random random(seed);
    const Sim3d local_from_coarse(random.Uniform(0.5, 2.0),
                                  ExpSo3(random.UnitVector()),
                                  random.GaussianVector(10.0));
    EXPECT_FALSE(ComputeGlobalCandidate(*scene, 15).has_value());
    for (image_t image_id = 5; image_id < 15; ++image_id) {
      Rigid3d pose = TransformCamFromWorld(local_from_coarse,
                                           world.coarse_poses.at(image_id));
      // One wrong neighbour moves no median.
      if (image_id == 8) pose.translation.x() += 50.0;
      SetCamFromWorld(pose, &scene->reconstruction.Image(image_id));
      scene->reconstruction.RegisterImage(image_id);
    }
    const auto candidate = ComputeGlobalCandidate(*scene, 15);
    ASSERT_TRUE(candidate.has_value());
    EXPECT_TRUE(PosesNear(
        *candidate,
        TransformCamFromWorld(local_from_coarse, world.coarse_poses.at(15)),
        1e-3, 1e-2));
  }
}

TEST(LocalMapper, GlobalCandidateCanBeSwitchedOff) {
  const MapperWorld world = BuildMapperWorld(SmallWorld(1));
  LocalMapperOptions options;
  options.registration.use_global_candidate = false;
  const LocalMapResult result = ReconstructLocally(
      options, world.data, world.coarse_poses, AllImages(world));
  EXPECT_EQ(result.num_registered_by_global_pose, 0);
  EXPECT_EQ(result.reconstruction.NumRegImages(), 30);
}

TEST(CoarseEdges, AreThoseOfTheAugmentedGraph) {
  MapperWorldOptions options = SmallWorld(1);
  options.world.num_blackouts = 1;
  options.world.blackout_num_images = 3;
  MapperWorld world = BuildMapperWorld(options);
  const image_t lost = world.coarse_poses.begin()->first;
  world.coarse_poses.erase(lost);
  const std::set<image_t> images = AllImages(world);
  const auto scene = BuildMapperScene(world.data, world.coarse_poses, images);
  std::set<std::pair<image_t, image_t>> expected;
  for (const ScenePair& pair : world.data.pairs) {
    expected.insert(std::minmax(pair.image_id1, pair.image_id2));
  }
  const size_t num_matched = expected.size();
  for (const RelativePosePrior& prior : world.data.priors) {
    expected.insert(std::minmax(prior.image_id1, prior.image_id2));
  }
  ASSERT_GT(expected.size(), num_matched);
  std::set<std::pair<image_t, image_t>> found;
  for (const PosePriorEdge& edge : FindCoarseEdges(*scene, images)) {
    EXPECT_TRUE(found.emplace(edge.image_id1, edge.image_id2).second);
    EXPECT_TRUE(
        PosesNear(edge.cam2_from_cam1,
                  ComputeCam2FromCam1(world.coarse_poses.at(edge.image_id1),
                                      world.coarse_poses.at(edge.image_id2)),
                  1e-12, 1e-12));
    EXPECT_TRUE(std::isfinite(edge.rotation_sigma_rad));
    EXPECT_TRUE(std::isfinite(edge.direction_sigma_rad));
    EXPECT_FALSE(std::isfinite(edge.length_sigma_m));
    EXPECT_LT(edge.dt_s, 0.0);
  }
  for (auto it = expected.begin(); it != expected.end();) {
    const bool is_known = it->first != lost && it->second != lost;
    it = is_known ? std::next(it) : expected.erase(it);
  }
  EXPECT_EQ(found, expected);
}

// If keypoints have hardly any weight, the part takes the shape of the coarse
// model.
TEST(LocalMapper, CoarseMotionsDrawThePart) {
  const MapperWorld world = BuildMapperWorld(SmallWorld(1));
  const auto mean_angle_to_coarse_rad = [&world](bool use_coarse_motions) {
    LocalMapperOptions options;
    options.use_priors_in_adjustment = false;
    options.use_coarse_motions_in_parts = use_coarse_motions;
    options.keypoint_sigma_px = 1e3;
    const colmap::Reconstruction model =
        ReconstructLocally(options, world.data, world.coarse_poses,
                           AllImages(world))
            .reconstruction;
    double sum_rad = 0.0;
    int count = 0;
    for (const RelativePosePrior& prior : world.data.priors) {
      if (!IsRegistered(model, prior.image_id1) ||
          !IsRegistered(model, prior.image_id2)) {
        continue;
      }
      sum_rad += AngleBetweenRad(
          ComputeCam2FromCam1(CamFromWorld(model.Image(prior.image_id1)),
                              CamFromWorld(model.Image(prior.image_id2)))
              .rotation,
          ComputeCam2FromCam1(world.coarse_poses.at(prior.image_id1),
                              world.coarse_poses.at(prior.image_id2))
              .rotation);
      ++count;
    }
    return sum_rad / count;
  };
  EXPECT_LT(mean_angle_to_coarse_rad(true),
            0.1 * mean_angle_to_coarse_rad(false));
}

TEST(LocalMapper, FewGlobalAdjustments) {
  const MapperWorld world = BuildMapperWorld(SmallWorld(2));
  const LocalMapResult result =
      ReconstructLocally({}, world.data, world.coarse_poses, AllImages(world));
  EXPECT_LE(result.num_global_adjustments, 7);
}

// Deep in a stop all matches are with images of the same place. What a batch
// sees must keep its depth from the images that saw it on the way there.
TEST(LocalMapper, ImagesAtRestAreRegistered) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildMapperWorld(WorldWithStop(240, 60.0, seed));
    // The way to the stop and most of its images.
    std::set<image_t> images;
    for (image_t image_id = 1; image_id <= 170; ++image_id) {
      images.insert(image_id);
    }
    const LocalMapResult result =
        ReconstructLocally({}, world.data, world.coarse_poses, images);
    EXPECT_EQ(result.reconstruction.NumRegImages(), 170) << "seed " << seed;
  }
}

TEST(LocalMapper, ThrowsWithoutAnInitialPair) {
  MapperWorld world = BuildMapperWorld(SmallWorld(1));
  world.data.pairs.clear();
  EXPECT_THROW(
      ReconstructLocally({}, world.data, world.coarse_poses, AllImages(world)),
      std::runtime_error);
}

TEST(PriorSupport, ComparesWhatTheFlagsClaim) {
  RelativePosePrior prior;
  prior.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, -2.0);
  prior.covariance = 1e-6 * Eigen::Matrix<double, 6, 6>::Identity();
  prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
  Rigid3d motion = prior.cam2_from_cam1;
  EXPECT_TRUE(IsSupportedByPrior(prior, motion));
  motion.translation *= 1.5;
  EXPECT_FALSE(IsSupportedByPrior(prior, motion));
  prior.flags = kPriorRotation;
  EXPECT_TRUE(IsSupportedByPrior(prior, motion));
  motion.rotation = ExpSo3(Eigen::Vector3d(0.0, 0.2, 0.0));
  EXPECT_FALSE(IsSupportedByPrior(prior, motion));
  prior.flags = 0;
  EXPECT_FALSE(IsSupportedByPrior(prior, motion));
}

}  // namespace
}  // namespace adasfm
