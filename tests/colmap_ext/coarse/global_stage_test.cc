// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_stage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>

#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/coarse/global_warnings.h"
#include "colmap_ext/coarse/refine_stage_matches.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/raw_matches.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "tests/testing/colmap_ext/global_stage_run.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

TEST(RunGlobalStageTest, FindsAMetricUprightModel) {
  for (const uint64_t seed : {1, 2}) {
    SyntheticWorldOptions options = SmallWorld();
    options.seed = seed;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const GlobalStageResult result =
        RunStage(BuildSyntheticScene(world, SyntheticPriorOptions()));
    ASSERT_EQ(result.models.size(), 1);
    EXPECT_TRUE(result.models[0].metric);
    EXPECT_TRUE(result.models[0].gravity_aligned);
    EXPECT_EQ(result.models[0].reconstruction.NumRegImages(), 60);
    const PoseErrors errors =
        ComparePoses(world, result.models[0].reconstruction);
    EXPECT_LT(errors.rmse_m, 0.3) << seed;
    EXPECT_NEAR(errors.scale, 1.0, 0.01) << seed;
  }
}

TEST(RunGlobalStageTest, FisheyeToo) {
  SyntheticWorldOptions options = SmallWorld();
  options.camera_model = SyntheticCameraModel::kFisheye;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const GlobalStageResult result =
      RunStage(BuildSyntheticScene(world, SyntheticPriorOptions()));
  ASSERT_EQ(result.models.size(), 1);
  EXPECT_LT(ComparePoses(world, result.models[0].reconstruction).rmse_m, 0.3);
}

TEST(RunGlobalStageTest, WithoutSensorsTheScaleIsOpen) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  SyntheticPriorOptions priors;
  priors.enabled = false;
  const GlobalStageResult result = RunStage(BuildSyntheticScene(world, priors));
  ASSERT_GE(result.models.size(), 1);
  EXPECT_FALSE(result.models[0].metric);
  EXPECT_FALSE(result.models[0].gravity_aligned);
  EXPECT_EQ(result.models[0].reconstruction.NumRegImages(), 60);
  EXPECT_LT(ComparePoses(world, result.models[0].reconstruction).rmse_m, 0.3);
}

TEST(RunGlobalStageTest, RefinedMatchesAreTrueOnes) {
  SyntheticWorldOptions options = SmallWorld();
  options.num_images = 200;
  options.alias_pair_ratio = 0.05;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  const GlobalStageResult result = RunStage(scene);
  size_t num_matches = 0, num_true = 0, num_true_raw = 0;
  const auto is_true = [&](const ImagePair& pair, const FeatureMatch& match) {
    return world.images[pair.image_id1 - 1].landmark_ids[match.point2D_idx1] ==
           world.images[pair.image_id2 - 1].landmark_ids[match.point2D_idx2];
  };
  for (const NewTwoViewGeometry& geometry : result.geometries) {
    for (const FeatureMatch& match : geometry.inlier_matches) {
      num_matches += 1;
      num_true += is_true(geometry.pair, match);
    }
  }
  for (const ScenePair& pair : scene.pairs) {
    for (const FeatureMatch& match : pair.raw_matches) {
      num_true_raw += is_true({pair.image_id1, pair.image_id2}, match);
    }
  }
  EXPECT_GT(num_true, 0.98 * num_matches);
  EXPECT_GT(num_true, 0.9 * num_true_raw);
  // Every pair is accounted for once.
  EXPECT_EQ(result.geometries.size() + result.removed_pairs.size() +
                result.refinement.num_skipped_pairs,
            scene.pairs.size());
  // Pairs that contradict the odometry are named as such.
  std::istringstream lines(FormatRemovedPairs(scene, result));
  std::string line;
  size_t num_lines = 0, num_refuted = 0;
  while (std::getline(lines, line)) {
    ++num_lines;
    num_refuted += line.find("\tcontradicts odometry") != std::string::npos;
  }
  EXPECT_EQ(num_lines, result.removed_pairs.size());
  EXPECT_GT(num_refuted, 0);
}

// Two equal photos of a stationary camera, whose poses differ by rounding.
TEST(RefineStageMatchesTest, EqualPhotosHaveNoGeometry) {
  SceneData scene = BuildSyntheticScene(BuildSyntheticWorld(SmallWorld()),
                                        SyntheticPriorOptions());
  GlobalStageResult result = RunStage(scene);
  ScenePair& pair = scene.pairs.front();
  SceneImage& copy = scene.images.at(pair.image_id2);
  copy.keypoints = scene.images.at(pair.image_id1).keypoints;
  pair.inlier_matches.clear();
  for (uint32_t i = 0; i < copy.keypoints.size(); ++i) {
    pair.inlier_matches.push_back({i, i});
  }
  pair.raw_matches = pair.inlier_matches;
  colmap::Reconstruction& model = result.models[0].reconstruction;
  Rigid3d pose = CamFromWorld(model.Image(pair.image_id1));
  pose.translation.x() += 1e-14;
  SetCamFromWorld(pose, &model.Image(pair.image_id2));
  result.geometries.clear();
  result.removed_pairs.clear();
  RefineStageMatches(GlobalStageOptions(), scene, RawMatchesOfScene(scene),
                     ComputeSceneBearings(scene, 1), &result);
  EXPECT_FALSE(result.geometries.empty());
  // The matches of the pair agree, so that it is not removed and keeps its
  // verified row.
  const ImagePair equal(pair.image_id1, pair.image_id2);
  EXPECT_EQ(std::count(result.removed_pairs.begin(), result.removed_pairs.end(),
                       equal),
            0);
  for (const NewTwoViewGeometry& geometry : result.geometries) {
    EXPECT_FALSE(geometry.cam2_from_cam1.translation.isZero());
  }
}

// With keypoint noise of 2 px half of the true matches are more than 4 px from
// their epipolar lines.
TEST(RunGlobalStageTest, NoisyKeypointsKeepTheirMatches) {
  SyntheticWorldOptions options = SmallWorld();
  options.pixel_noise_px = 2.0;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  const GlobalStageResult result = RunStage(scene);
  size_t num_kept = 0, num_true_raw = 0;
  for (const NewTwoViewGeometry& geometry : result.geometries) {
    num_kept += geometry.inlier_matches.size();
  }
  for (const ScenePair& pair : scene.pairs) {
    for (const FeatureMatch& match : pair.raw_matches) {
      num_true_raw +=
          world.images[pair.image_id1 - 1].landmark_ids[match.point2D_idx1] ==
          world.images[pair.image_id2 - 1].landmark_ids[match.point2D_idx2];
    }
  }
  EXPECT_GT(num_kept, 0.85 * num_true_raw);
}

// Two-view verification takes the motion relative to cars ahead for that of the
// camera. The odometry contradicts that motion, and raw matches on the town
// constrain the images.
TEST(RunGlobalStageTest, TrafficDoesNotHideTheTown) {
  SyntheticWorldOptions options = SmallWorld();
  options.moving_keypoint_ratio = 0.5;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  const GlobalStageResult result =
      RunStage(BuildSyntheticScene(world, SyntheticPriorOptions()));
  ASSERT_EQ(result.models.size(), 1);
  EXPECT_EQ(result.models[0].reconstruction.NumRegImages(), 60);
  EXPECT_EQ(result.models[0].num_images_without_points, 0);
  EXPECT_LT(ComparePoses(world, result.models[0].reconstruction).rmse_m, 0.2);
}

TEST(RunGlobalStageTest, SameResultOnAnyNumberOfThreads) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  const SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  GlobalStageOptions options;
  options.num_threads = 1;
  const GlobalStageResult single = RunStage(scene, options);
  options.num_threads = 2;
  const GlobalStageResult several = RunStage(scene, options);
  for (const auto& [image_id, pose] :
       CamsFromWorld(single.models[0].reconstruction)) {
    EXPECT_EQ(several.models[0].reconstruction.Image(image_id).Tvec(),
              pose.translation);
  }
  EXPECT_EQ(single.geometries.size(), several.geometries.size());
}

// The true camera-IMU rotation is 3 deg off the calibration. No weights
// reconcile vision and sensors, unless the rotation is corrected or the
// adjustment estimates the direction of driving.
TEST(RunGlobalStageTest,
     CorrectsTheCameraImuRotationOrWarnsOfTheContradiction) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  EXPECT_TRUE(ListGlobalWarnings(scene, RunStage(scene)).empty());
  const Eigen::Quaterniond turn =
      ExpSo3(DegToRad(3.0) * Eigen::Vector3d::UnitY());
  for (RelativePosePrior& prior : scene.priors) RotatePrior(turn, &prior);
  GlobalStageOptions options;
  options.poses.camera_imu_rotation.enabled = false;
  const GlobalStageResult found = RunStage(scene, options);
  EXPECT_TRUE(found.models[0].priors_agree);
  options.structure.bundle.shared_errors.enabled = false;
  const GlobalStageResult left = RunStage(scene, options);
  EXPECT_FALSE(left.models[0].priors_agree);
  std::vector<std::string> warnings = ListGlobalWarnings(scene, left);
  ASSERT_EQ(warnings.size(), 1);
  EXPECT_NE(warnings[0].find("T_cam_imu"), std::string::npos);

  const GlobalStageResult corrected = RunStage(scene);
  EXPECT_TRUE(corrected.models[0].priors_agree);
  const CameraImuRotationReport& camera_imu =
      corrected.poses.camera_imu_rotations.at(0);
  EXPECT_TRUE(camera_imu.corrected);
  EXPECT_NEAR(camera_imu.rotation_rad.y(), -DegToRad(3.0),
              4.0 * camera_imu.sigma_rad);
  // The drive of 90 m turns little, so that roll is weakly observed; it is not
  // corrected where it is uncertain.
  EXPECT_LT(AngleBetweenRad(ExpSo3(camera_imu.rotation_rad) * turn,
                            Eigen::Quaterniond::Identity()),
            DegToRad(0.6));
  warnings = ListGlobalWarnings(scene, corrected);
  ASSERT_EQ(warnings.size(), 1);
  EXPECT_NE(warnings[0].find("camera-IMU rotation"), std::string::npos);
  // A rotation that is not significant causes no warning, since the direction
  // of driving explains it too.
  GlobalStageResult uncertain = corrected;
  uncertain.poses.camera_imu_rotations.at(0).sigma_rad =
      0.4 * camera_imu.rotation_rad.norm();
  EXPECT_TRUE(ListGlobalWarnings(scene, uncertain).empty());
}

// The T_cam_imu of the second of two machines is 3 deg off.
TEST(RunGlobalStageTest, CorrectsTheCameraImuRotationOfADriveByItself) {
  SyntheticWorldOptions options = SmallWorld();
  options.num_images = 160;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  const Eigen::Quaterniond turn =
      ExpSo3(DegToRad(3.0) * Eigen::Vector3d::UnitY());
  const size_t half = scene.priors.size() / 2;
  for (size_t k = half; k < scene.priors.size(); ++k) {
    scene.priors[k].drive = 1;
    RotatePrior(turn, &scene.priors[k]);
  }
  scene.priors.erase(scene.priors.begin() + half);
  const CameraImuRotationReports found =
      RunStage(scene).poses.camera_imu_rotations;
  EXPECT_FALSE(found.at(0).corrected);
  EXPECT_TRUE(found.at(1).corrected);
  EXPECT_NEAR(found.at(1).rotation_rad.y(), -DegToRad(3.0),
              4.0 * found.at(1).sigma_rad);
}

// A phone that was never stationary, and vision too poor to estimate the bias:
// true loops contradict the odometry unless the stage is given the uncertainty
// of the bias.
TEST(RunGlobalStageTest, GatesLoopsByTheStatedBias) {
  SyntheticWorldOptions options = SmallWorld();
  options.num_images = 120;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  for (RelativePosePrior& prior : scene.priors) {
    Rigid3d& motion = prior.cam2_from_cam1;
    motion.rotation =
        ExpSo3(SecondsFromNs(prior.dt_ns) * Eigen::Vector3d(0.0, 0.03, 0.0)) *
        motion.rotation;
  }
  const auto count_refuted = [](const SceneData& scene) {
    const GlobalStageResult result = RunStage(scene);
    return std::count_if(result.poses.graph.edges.begin(),
                         result.poses.graph.edges.end(),
                         [](const ViewGraphEdge& edge) {
                           return edge.removal == EdgeRemoval::kOdometry ||
                                  edge.removal == EdgeRemoval::kOdometryPose ||
                                  edge.removal == EdgeRemoval::kFalseLoop;
                         });
  };
  EXPECT_GT(count_refuted(scene), 20);
  scene.gyroscope_bias_covariance =
      std::pow(0.03, 2) * Eigen::Matrix3d::Identity();
  EXPECT_EQ(count_refuted(scene), 0);
}

TEST(RunGlobalStageTest, SwitchesOffMatchRefinement) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  GlobalStageOptions options;
  options.refinement.enabled = false;
  const GlobalStageResult result =
      RunStage(BuildSyntheticScene(world, SyntheticPriorOptions()), options);
  EXPECT_TRUE(result.geometries.empty());
  EXPECT_TRUE(result.removed_pairs.empty());
}

TEST(RunGlobalStageTest, AnEmptySceneIsAnError) {
  SceneData scene;
  const StatusOr<GlobalStageResult> result =
      RunGlobalStage(GlobalStageOptions(), &scene);
  EXPECT_FALSE(result.ok());
  EXPECT_FALSE(result.status().message().empty());
}

TEST(RunGlobalStageTest, ReportsEveryStep) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  const SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  GlobalStageResult result = RunStage(scene);
  EXPECT_TRUE(ListGlobalWarnings(scene, result).empty());
  const std::string json = FormatGlobalReportJson(scene, result, 1.0);
  for (const CoarseStep& step : result.steps) {
    EXPECT_NE(json.find("\"" + step.name + "\""), std::string::npos);
  }
  for (const char* figure :
       {"pairs_agree", "pair_agreement", "least_pair_agreement",
        "rotation_optimality", "max_track_bytes", "focal_length_camera"}) {
    EXPECT_NE(json.find("\"" + std::string(figure) + "\""), std::string::npos)
        << figure;
  }
  const std::string text = FormatGlobalReportText(result, 1.0);
  EXPECT_NE(text.find("60 images"), std::string::npos);
  EXPECT_NE(text.find("of the pairs agree"), std::string::npos);
  result.models[0].pair_agreement.least_image_share = 0.5;
  const std::vector<std::string> warnings = ListGlobalWarnings(scene, result);
  ASSERT_EQ(warnings.size(), 1);
  EXPECT_NE(warnings[0].find("contradicts vision"), std::string::npos);
  EXPECT_NE(FormatGlobalReportJson(scene, result, 1.0).find(warnings[0]),
            std::string::npos);
}

TEST(RunGlobalStageTest, StatesTheMemoryOfTracksBeforeItIsUsed) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld());
  SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
  std::vector<std::string> names;
  ASSERT_TRUE(RunGlobalStage(GlobalStageOptions(), &scene,
                             [&](const std::string& name, double) {
                               names.push_back(name);
                             })
                  .ok());
  EXPECT_TRUE(std::any_of(names.begin(), names.end(), [](const auto& name) {
    return name.find("tracks take at most") != std::string::npos;
  }));
}

}  // namespace
}  // namespace adasfm
