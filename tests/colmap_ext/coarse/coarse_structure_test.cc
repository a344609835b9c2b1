// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/coarse_structure.h"

#include <gtest/gtest.h>

#include "colmap_ext/host/camera.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

struct Fixture {
  SyntheticWorld world;
  SceneData scene;
  std::map<image_t, std::vector<Bearing>> bearings;
  CoarseModelInput input;
};

// True poses with normal errors: sigma_m, and 0.3 deg per metre of sigma_m.
Fixture BuildFixture(const SyntheticWorldOptions& options, double sigma_m) {
  Fixture fixture;
  fixture.world = BuildSyntheticWorld(options);
  fixture.scene = BuildSyntheticScene(fixture.world, SyntheticPriorOptions());
  Random random(options.seed);
  for (const SyntheticImage& image : fixture.world.images) {
    const Rigid3d& pose = image.cam_from_world;
    fixture.input.cams_from_world[image.image_id] = CamFromWorldWithCenter(
        ExpSo3(random.GaussianVector(DegToRad(0.3) * sigma_m)) * pose.rotation,
        pose.TargetOriginInSource() + random.GaussianVector(sigma_m));
    fixture.bearings[image.image_id] =
        ComputeBearings(fixture.scene.cameras.at(1), image.keypoints);
  }
  for (const ScenePair& pair : fixture.scene.pairs) {
    fixture.input.matches[ImagePair(pair.image_id1, pair.image_id2)] =
        pair.inlier_matches;
  }
  fixture.input.metric = true;
  fixture.input.priors = fixture.scene.priors;
  return fixture;
}

SyntheticWorldOptions SmallWorld() {
  SyntheticWorldOptions options;
  options.num_images = 40;
  return options;
}

TEST(BuildCoarseModelTest, AdjustsPosesAndKeepsMetres) {
  for (const uint64_t seed : {1, 2}) {
    SyntheticWorldOptions options = SmallWorld();
    options.seed = seed;
    const Fixture fixture = BuildFixture(options, 0.2);
    const CoarseModel model =
        BuildCoarseModel(CoarseStructureOptions(), fixture.scene,
                         fixture.bearings, fixture.input);
    ASSERT_EQ(model.reconstruction.NumRegImages(), 40);
    const PoseErrors errors = ComparePoses(fixture.world, model.reconstruction);
    EXPECT_LT(errors.rmse_m, 0.1);
    EXPECT_NEAR(errors.scale, 1.0, 0.01);
    EXPECT_GT(model.num_points, 100);
    EXPECT_EQ(model.rounds.size(), 3);
  }
}

// Keyframes save residuals, but lead to the same model.
TEST(BuildCoarseModelTest, KeyframesLeadToTheSameModel) {
  for (const uint64_t seed : {1, 2}) {
    SyntheticWorldOptions options = SmallWorld();
    options.seed = seed;
    options.spacing_m = 0.5;
    const Fixture fixture = BuildFixture(options, 0.1);
    CoarseStructureOptions structure;
    const CoarseModel all = BuildCoarseModel(structure, fixture.scene,
                                             fixture.bearings, fixture.input);
    EXPECT_EQ(all.num_keyframes, 40);
    const CoarseModel model = BuildCoarseModel(
        structure, fixture.scene, fixture.bearings, fixture.input, 10);
    EXPECT_LT(model.num_keyframes, 30);
    EXPECT_LT(model.rounds[0].num_residuals, all.rounds[0].num_residuals);
    EXPECT_EQ(model.rounds[0].num_images, all.rounds[0].num_images);
    const double rmse_m =
        ComparePoses(fixture.world, model.reconstruction).rmse_m;
    const double all_rmse_m =
        ComparePoses(fixture.world, all.reconstruction).rmse_m;
    EXPECT_NEAR(rmse_m, all_rmse_m, 0.1 * all_rmse_m + 0.001);
    EXPECT_NEAR(model.num_points, all.num_points, 0.05 * all.num_points);
  }
}

TEST(BuildCoarseModelTest, TurnsTheWorldUpright) {
  Fixture fixture = BuildFixture(SmallWorld(), 0.02);
  const Sim3d tilt(1.0, ExpSo3(Eigen::Vector3d(0.4, -0.9, 0.2)),
                   Eigen::Vector3d(5.0, 6.0, 7.0));
  for (auto& [image_id, pose] : fixture.input.cams_from_world) {
    pose = TransformCamFromWorld(tilt, pose);
  }
  const CoarseModel model = BuildCoarseModel(
      CoarseStructureOptions(), fixture.scene, fixture.bearings, fixture.input);
  EXPECT_TRUE(model.gravity_aligned);
  for (const image_t id : model.reconstruction.RegImageIds()) {
    const Eigen::Vector3d down =
        CamFromWorld(model.reconstruction.Image(id)).rotation.conjugate() *
        *fixture.scene.images.at(id).gravity_in_cam;
    EXPECT_LT(AngleBetweenRad(down, -Eigen::Vector3d::UnitZ()), DegToRad(1.0));
  }
}

TEST(BuildCoarseModelTest, PriorsCarryImagesWithoutTexture) {
  SyntheticWorldOptions options = SmallWorld();
  options.num_blackouts = 1;
  options.blackout_num_images = 8;
  const Fixture fixture = BuildFixture(options, 0.1);
  const CoarseModel model = BuildCoarseModel(
      CoarseStructureOptions(), fixture.scene, fixture.bearings, fixture.input);
  EXPECT_EQ(model.reconstruction.NumRegImages(), 40);
  EXPECT_GT(model.num_images_without_points, 0);
  EXPECT_LT(ComparePoses(fixture.world, model.reconstruction).rmse_m, 0.1);
}

// On a straight drive a wide minimum angle would leave images without points.
TEST(BuildCoarseModelTest, LowersTheAngleWhereImagesNeedIt) {
  SyntheticWorldOptions options = SmallWorld();
  options.trajectory = SyntheticTrajectory::kStraight;
  options.spacing_m = 0.5;
  const Fixture fixture = BuildFixture(options, 0.02);
  CoarseStructureOptions structure;
  structure.triangulation.min_triangulation_angle_deg = 30.0;
  const CoarseModel model = BuildCoarseModel(structure, fixture.scene,
                                             fixture.bearings, fixture.input);
  EXPECT_LT(model.min_angle_deg, 30.0);
  EXPECT_GE(model.min_angle_deg, 1.0);
}

// With a fixed last threshold of 4 px, 3 px of noise would appear as 1.9 px,
// and half of the observations would be lost.
TEST(BuildCoarseModelTest, ThresholdFollowsTheNoise) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options = SmallWorld();
    options.seed = seed;
    options.pixel_noise_px = 3.0;
    const Fixture fixture = BuildFixture(options, 0.05);
    const CoarseModel model =
        BuildCoarseModel(CoarseStructureOptions(), fixture.scene,
                         fixture.bearings, fixture.input);
    EXPECT_NEAR(model.keypoint_sigma_px, 3.0, 0.3) << "seed " << seed;
  }
}

TEST(BuildCoarseModelTest, OptionsChangeTheOutcome) {
  const Fixture fixture = BuildFixture(SmallWorld(), 0.05);
  const auto build = [&](const CoarseStructureOptions& options) {
    return BuildCoarseModel(options, fixture.scene, fixture.bearings,
                            fixture.input);
  };
  const CoarseModel model = build(CoarseStructureOptions());
  CoarseStructureOptions options;
  options.use_priors = false;
  EXPECT_LT(build(options).rounds[0].num_residuals,
            model.rounds[0].num_residuals);
  options = CoarseStructureOptions();
  options.max_track_length = 3;
  const CoarseModel short_tracks = build(options);
  EXPECT_LE(short_tracks.num_observations, 3 * short_tracks.num_points);
  EXPECT_GT(model.num_observations, 3 * model.num_points);
}

TEST(CoarseStructureOptionsTest, NamesTheBrokenRule) {
  std::string error;
  EXPECT_TRUE(CoarseStructureOptions().IsValid(&error));
  CoarseStructureOptions options;
  options.max_track_length = 2;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("max_track_length"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
