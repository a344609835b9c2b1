// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/coarse/global_warnings.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/global_stage_run.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"
#include "tests/testing/colmap_ext/unknown_lens.h"

namespace adasfm {
namespace {

// A world whose road turns by 93 deg.
SyntheticWorldOptions TurningWorld() {
  SyntheticWorldOptions options = SmallWorld();
  options.seed = 2;
  return options;
}

void ScaleFocalLength(double ratio, SceneData* scene, camera_t camera_id = 1) {
  colmap::Camera& camera = scene->cameras.at(camera_id);
  for (const size_t i : camera.FocalLengthIdxs()) camera.Params(i) *= ratio;
}

// A focal length that is 3 % too long distorts the epipolar lines. Matches are
// judged by the focal length that the adjustment has estimated.
TEST(GlobalStageLensTest, MatchesAreRefinedUnderRefinedCameras) {
  for (const uint64_t seed : {1, 2}) {
    SyntheticWorldOptions world_options = SmallWorld();
    world_options.seed = seed;
    const SyntheticWorld world = BuildSyntheticWorld(world_options);
    SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    const auto set_focal_length = [&](double focal_px) {
      scene.cameras.at(1).InitializeWithName(
          "SIMPLE_PINHOLE", focal_px, world.camera.width, world.camera.height);
      scene.cameras.at(1).SetCameraId(1);
    };
    set_focal_length(world.camera.focal_px);
    const GlobalStageResult right = RunStage(scene);
    set_focal_length(1.03 * world.camera.focal_px);
    GlobalStageOptions options;
    options.structure.bundle.refine_focal_length = true;
    // A gyroscope without bias determines the focal length of so short a drive.
    options.structure.bundle.shared_errors.enabled = false;
    const GlobalStageResult refined = RunStage(scene, options);
    ASSERT_EQ(refined.models.size(), 1);
    EXPECT_NEAR(refined.models[0].reconstruction.Camera(1).FocalLength() /
                    world.camera.focal_px,
                1.0, 0.003);
    EXPECT_NEAR(refined.refinement.num_kept, right.refinement.num_kept,
                0.005 * right.refinement.num_kept)
        << seed;
  }
}

TEST(GlobalStageLensTest, WarnsOfAWrongFocalLength) {
  for (const double ratio : {0.9, 0.97, 1.0, 1.03}) {
    const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
    SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    ScaleFocalLength(ratio, &scene);
    scene.cameras.at(1).SetPriorFocalLength(true);
    const GlobalStageResult result = RunStage(scene);
    const auto& error = result.models[0].focal_length_error;
    ASSERT_EQ(error.has_value(), ratio != 1.0) << ratio;
    if (!error) continue;
    EXPECT_NEAR(error->ratio, 1.0 / ratio, 0.01);
    EXPECT_NEAR(error->ratio, 1.0 / ratio, 4.0 * error->sigma);
    const std::vector<std::string> warnings = ListGlobalWarnings(scene, result);
    ASSERT_FALSE(warnings.empty());
    EXPECT_NE(warnings[0].find(ratio > 1.0 ? "shorter" : "longer"),
              std::string::npos);
    // Errors of the user's cameras are reported, not corrected.
    EXPECT_FALSE(result.models[0].cameras_refined);
    EXPECT_EQ(result.models[0].reconstruction.Camera(1).Params(),
              scene.cameras.at(1).Params());
  }
}

// On a straight road shared errors of the priors look like a focal length.
TEST(GlobalStageLensTest, SaysNothingOfFocalLengthsOnStraightRoads) {
  SyntheticWorldOptions options = SmallWorld();
  options.trajectory = SyntheticTrajectory::kStraight;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  ScaleFocalLength(1.1, &scene);
  EXPECT_FALSE(RunStage(scene).models[0].focal_length_error.has_value());
}

TEST(GlobalStageLensTest, RefinesAFocalLengthThatNobodyKnows) {
  const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  const double focal_px = scene.cameras.at(1).MeanFocalLength();
  const GlobalStageResult right = RunStage(scene);
  ScaleFocalLength(1.05, &scene);
  scene.cameras.at(1).SetPriorFocalLength(false);
  GlobalStageOptions options;
  options.focal_lengths.enabled = false;
  const GlobalStageResult refined = RunStage(scene, options);
  EXPECT_TRUE(refined.models[0].cameras_refined);
  EXPECT_NEAR(refined.refinement.num_kept, right.refinement.num_kept,
              0.005 * right.refinement.num_kept);
  options.structure.refine_unknown_focal_length = false;
  const GlobalStageResult left = RunStage(scene, options);
  EXPECT_FALSE(left.models[0].cameras_refined);
  ASSERT_TRUE(left.models[0].focal_length_error.has_value());
  const double sigma = left.models[0].focal_length_error->sigma;
  EXPECT_LT(sigma, 0.003);
  EXPECT_NEAR(
      refined.models[0].reconstruction.Camera(1).MeanFocalLength() / focal_px,
      1.0, 3.0 * sigma);
  EXPECT_LT(ComparePoses(world, refined.models[0].reconstruction).rmse_m,
            ComparePoses(world, left.models[0].reconstruction).rmse_m);
}

// The search precedes all other steps, as COLMAP's guess spoils two-view
// rotations.
TEST(GlobalStageLensTest, FindsAFocalLengthThatNobodyKnows) {
  const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  const double focal_px = scene.cameras.at(1).MeanFocalLength();
  ScaleFocalLength(1.5, &scene);
  scene.cameras.at(1).SetPriorFocalLength(false);
  GlobalStageOptions options;
  options.focal_lengths.enabled = false;
  EXPECT_TRUE(RunStage(scene, options).focal_lengths.empty());
  const GlobalStageResult result = RunStage(scene);
  ASSERT_EQ(result.focal_lengths.size(), 1);
  EXPECT_NEAR(
      result.models[0].reconstruction.Camera(1).MeanFocalLength() / focal_px,
      1.0, 0.01);
}

// The root mean square of the angles to the priors' rotations.
double RotationErrorDeg(const std::vector<RelativePosePrior>& priors,
                        const colmap::Reconstruction& model) {
  double sum = 0.0;
  for (const RelativePosePrior& prior : priors) {
    const Rigid3d motion =
        ComputeCam2FromCam1(CamFromWorld(model.Image(prior.image_id1)),
                            CamFromWorld(model.Image(prior.image_id2)));
    sum += std::pow(
        motion.rotation.angularDistance(prior.cam2_from_cam1.rotation), 2);
  }
  return RadToDeg(std::sqrt(sum / priors.size()));
}

// Worlds with turns: the roads of seeds 1 and 4 do not determine the lens.
TEST(GlobalStageLensTest, AdjustsALensThatNobodyKnows) {
  for (const uint64_t seed : {2, 3}) {
    SyntheticWorldOptions world_options = TurningWorld();
    world_options.seed = seed;
    const SyntheticWorld world = BuildSyntheticWorld(world_options);
    SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    UseUnknownLens(0.12, -0.12, 1.6, &scene);
    const GlobalStageResult result = RunStage(scene);
    ASSERT_EQ(result.models.size(), 1) << seed;
    EXPECT_TRUE(result.models[0].cameras_refined);
    const colmap::Reconstruction& model = result.models[0].reconstruction;
    EXPECT_EQ(model.NumRegImages(), world.images.size());
    const colmap::Camera& camera = model.Camera(1);
    EXPECT_EQ(camera.ModelName(), "RADIAL");
    EXPECT_NEAR(camera.MeanFocalLength() / world.camera.focal_px, 1.0, 0.01)
        << seed;
    EXPECT_NEAR(camera.Params(3), 0.12, 0.02) << seed;
    EXPECT_NEAR(camera.Params(4), -0.12, 0.02) << seed;
    // The priors' sigma is 0.03 deg about each axis.
    EXPECT_LT(RotationErrorDeg(scene.priors, model), 0.1) << seed;
  }
}

// Which images of a drive of 60 are of camera 2, whose focal length is 1.2
// times that of camera 1.
enum class SecondCamera { kEveryOther, kSecondHalf };
constexpr SecondCamera kSecondCameras[] = {SecondCamera::kEveryOther,
                                           SecondCamera::kSecondHalf};

SceneData SceneOfTwoCameras(const SyntheticWorld& world, SecondCamera which) {
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  scene.cameras[2] = scene.cameras.at(1);
  scene.cameras.at(2).SetCameraId(2);
  ScaleFocalLength(1.2, &scene, 2);
  const Eigen::Vector2d center(world.camera.principal_x_px,
                               world.camera.principal_y_px);
  for (auto& [image_id, image] : scene.images) {
    if (which == SecondCamera::kEveryOther ? image_id % 2 : image_id <= 30) {
      continue;
    }
    image.camera_id = 2;
    for (Eigen::Vector2d& keypoint : image.keypoints) {
      keypoint = center + 1.2 * (keypoint - center);
    }
  }
  return scene;
}

// A guess that is 10 % too long, with and without the search over pairs.
TEST(GlobalStageLensTest, RefinesAFocalLengthNextToAKnownOne) {
  const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
  for (const SecondCamera which : kSecondCameras) {
    SceneData scene = SceneOfTwoCameras(world, which);
    const double focal_px = scene.cameras.at(2).MeanFocalLength();
    const std::vector<double> known = ParamsOf(scene.cameras.at(1));
    ScaleFocalLength(1.1, &scene, 2);
    scene.cameras.at(2).SetPriorFocalLength(false);
    GlobalStageOptions options;
    options.focal_lengths.enabled = false;
    options.structure.refine_unknown_focal_length = false;
    const GlobalStageResult left = RunStage(scene, options);
    EXPECT_FALSE(left.models[0].cameras_refined);
    ASSERT_TRUE(left.models[0].focal_length_error.has_value());
    EXPECT_EQ(left.models[0].focal_length_error->camera_id, 2);
    // The sigma follows from the change of the cost.
    const double sigma = left.models[0].focal_length_error->sigma;
    EXPECT_LT(sigma, 0.005);
    options.structure.refine_unknown_focal_length = true;
    for (const bool is_searched : {false, true}) {
      options.focal_lengths.enabled = is_searched;
      const GlobalStageResult refined = RunStage(scene, options);
      ASSERT_EQ(refined.models.size(), 1);
      EXPECT_EQ(refined.focal_lengths.size(), is_searched);
      EXPECT_TRUE(refined.models[0].cameras_refined);
      const colmap::Reconstruction& model = refined.models[0].reconstruction;
      EXPECT_EQ(model.NumRegImages(), 60);
      EXPECT_NEAR(model.Camera(2).MeanFocalLength() / focal_px, 1.0,
                  3.0 * sigma)
          << is_searched;
      EXPECT_EQ(ParamsOf(model.Camera(1)), known);
      EXPECT_LT(ComparePoses(world, model).rmse_m,
                ComparePoses(world, left.models[0].reconstruction).rmse_m);
    }
  }
}

// The distortion of the unknown lens is adjusted, too.
TEST(GlobalStageLensTest, AdjustsALensNextToAKnownOne) {
  const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
  for (const SecondCamera which : kSecondCameras) {
    SceneData scene = SceneOfTwoCameras(world, which);
    const double focal_px = scene.cameras.at(2).MeanFocalLength();
    const std::vector<double> known = ParamsOf(scene.cameras.at(1));
    UseUnknownLens(0.12, -0.12, 1.6, &scene, 2);
    const GlobalStageResult result = RunStage(scene);
    ASSERT_EQ(result.models.size(), 1);
    EXPECT_EQ(result.focal_lengths.size(), 1);
    EXPECT_TRUE(result.models[0].cameras_refined);
    const colmap::Reconstruction& model = result.models[0].reconstruction;
    const colmap::Camera& camera = model.Camera(2);
    EXPECT_EQ(camera.ModelName(), "RADIAL");
    EXPECT_NEAR(camera.MeanFocalLength() / focal_px, 1.0, 0.01);
    EXPECT_NEAR(camera.Params(3), 0.12, 0.02);
    EXPECT_NEAR(camera.Params(4), -0.12, 0.02);
    EXPECT_EQ(ParamsOf(model.Camera(1)), known);
  }
}

// The wrong lens is only reported; the unknown one is right and stays as well.
TEST(GlobalStageLensTest, WarnsOfAWrongKnownLensNextToAnUnknownOne) {
  const SyntheticWorld world = BuildSyntheticWorld(TurningWorld());
  for (const SecondCamera which : kSecondCameras) {
    SceneData scene = SceneOfTwoCameras(world, which);
    ScaleFocalLength(1.05, &scene);
    scene.cameras.at(2).SetPriorFocalLength(false);
    const GlobalStageResult result = RunStage(scene);
    ASSERT_TRUE(result.models[0].focal_length_error.has_value());
    EXPECT_EQ(result.models[0].focal_length_error->camera_id, 1);
    const std::vector<std::string> warnings = ListGlobalWarnings(scene, result);
    ASSERT_FALSE(warnings.empty());
    EXPECT_NE(warnings[0].find("of camera 1: check"), std::string::npos)
        << warnings[0];
    for (const camera_t camera_id : {1, 2}) {
      EXPECT_EQ(ParamsOf(result.models[0].reconstruction.Camera(camera_id)),
                ParamsOf(scene.cameras.at(camera_id)));
    }
  }
}

}  // namespace
}  // namespace adasfm
