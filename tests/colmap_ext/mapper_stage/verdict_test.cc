// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/verdict_report.h"
#include "tests/testing/colmap_ext/mapper_stage_fixture.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

class VerdictTest : public MapperStageTest {
 protected:
  void SetUp() override {
    MapperStageTest::SetUp();
    MapperWorldOptions options;
    options.world.num_images = 40;
    world_ = BuildMapperWorld(options);
    MapperStage stage(options_, world_.data, world_.coarse_poses, folder_);
    ASSERT_TRUE(stage.Plan().ok());
    ASSERT_TRUE(stage.RunAllParts().ok());
    StatusOr<colmap::Reconstruction> model = stage.Merge(true);
    ASSERT_TRUE(model.ok()) << model.status().message();
    model_ = std::move(*model);
    summary_ = stage.Summary();
  }

  Verdict Assess(const std::vector<std::string>& warnings = {}) const {
    return AssessModel(world_.data, summary_, warnings, model_);
  }

  void ExpectResult(const Verdict& verdict, VerdictResult result,
                    const std::string& reason) {
    EXPECT_EQ(verdict.result, result) << FormatVerdict(verdict);
    EXPECT_THAT(FormatVerdict(verdict), HasSubstr(reason));
  }

  // Images that the database has and the model has not.
  void AddImages(int count) {
    for (int i = 0; i < count; ++i) {
      world_.data.images[1000 + i].image_id = 1000 + i;
    }
  }

  MapperWorld world_;
  colmap::Reconstruction model_;
};

TEST_F(VerdictTest, HonestModelIsGood) {
  const Verdict verdict = Assess();
  ExpectResult(verdict, VerdictResult::kGood, "in metres from wheels");
  EXPECT_EQ(verdict.num_images, 40);
  EXPECT_EQ(verdict.num_images_held_by_points, 40);
  ASSERT_EQ(verdict.priors.size(), 2);
  for (const PriorAgreement& priors : verdict.priors) {
    EXPECT_EQ(priors.num_priors, 39);
    EXPECT_GT(priors.chi2_ratio, 0.0);
    EXPECT_LT(priors.chi2_ratio, 1.5);
    EXPECT_LT(priors.share_contradicting, 0.05);
  }
  const nlohmann::json json = VerdictToJson(verdict);
  EXPECT_EQ(json["result"], "good");
  EXPECT_EQ(json["num_images"], 40);
  EXPECT_EQ(json["priors"][0]["kind"], "rotation");
  EXPECT_EQ(json["line"], FormatVerdict(verdict));
  EXPECT_FALSE(json.contains("metric_sigma"));
}

TEST_F(VerdictTest, SaysHowWellMetresAreKnown) {
  Verdict verdict = Assess();
  verdict.metric_sigma = 0.0074;
  ExpectResult(verdict, VerdictResult::kGood,
               "in metres from wheels (to 0.74 %)");
  EXPECT_EQ(VerdictToJson(verdict)["metric_sigma"], 0.0074);
}

TEST_F(VerdictTest, LostImages) {
  AddImages(1);
  ExpectResult(Assess(), VerdictResult::kGood, "40 of 41 images");
  AddImages(6);
  ExpectResult(Assess(), VerdictResult::kDoubtful, "6 of 46 images are lost");
  AddImages(50);
  ExpectResult(Assess(), VerdictResult::kFailed, "50 of 90 images are lost");
}

TEST_F(VerdictTest, ModelWithoutPointsFailed) {
  for (const colmap::point3D_t point_id : model_.Point3DIds()) {
    model_.DeletePoint3D(point_id);
  }
  ExpectResult(Assess(), VerdictResult::kFailed, "the model has no points");
}

// Poses from a wrong log: the matches are there, but they give no points.
TEST_F(VerdictTest, MatchedImagesWithoutPointsFailed) {
  std::vector<image_t> images = model_.RegImageIds();
  std::sort(images.begin(), images.end());
  for (size_t i = 0; i < images.size() * 6 / 10; ++i) {
    for (const colmap::Point2D& point : model_.Image(images[i]).Points2D()) {
      if (point.HasPoint3D()) model_.DeletePoint3D(point.Point3DId());
    }
  }
  ExpectResult(Assess(), VerdictResult::kFailed,
               "images with verified matches");
  // Images without matches, as in the dark, only make the model doubtful.
  world_.data.pairs.erase(
      std::remove_if(world_.data.pairs.begin(), world_.data.pairs.end(),
                     [&](const ScenePair& pair) {
                       const auto is_dark = [&](image_t image_id) {
                         return model_.Image(image_id).NumPoints3D() < 15;
                       };
                       return is_dark(pair.image_id1) ||
                              is_dark(pair.image_id2);
                     }),
      world_.data.pairs.end());
  ExpectResult(Assess(), VerdictResult::kDoubtful, "see too few points");
}

TEST_F(VerdictTest, SensorsThatContradictVision) {
  const SceneData honest = world_.data;
  const auto turn_every = [&](size_t step, double num_sigmas) {
    world_.data = honest;
    for (size_t i = 0; i < world_.data.priors.size(); i += step) {
      RelativePosePrior& prior = world_.data.priors[i];
      const double sigma_rad = std::sqrt(prior.covariance(0, 0));
      prior.cam2_from_cam1.rotation =
          ExpSo3(Eigen::Vector3d(num_sigmas * sigma_rad, 0.0, 0.0)) *
          prior.cam2_from_cam1.rotation;
    }
  };
  turn_every(1, 10.0);
  ExpectResult(Assess(), VerdictResult::kFailed, "rotations contradict");
  turn_every(8, 10.0);
  ExpectResult(Assess(), VerdictResult::kDoubtful, "rotations contradict");
  turn_every(39, 10.0);
  ExpectResult(Assess(), VerdictResult::kGood, "");
}

// A gyroscope that warms up slowly disagrees with vision, but does not
// contradict it; a bias that jumps to and fro does. Over steps of 2.5 s the
// largest bias turns by five sigmas of a prior (5e-4 rad).
TEST_F(VerdictTest, BiasesThatDriftAreNoContradiction) {
  const SceneData honest = world_.data;
  constexpr double kLargestRadS = 0.001;
  constexpr double kStepS = 2.5;
  const auto add_bias = [&](const auto& share_of_step) {
    world_.data = honest;
    std::vector<RelativePosePrior>& priors = world_.data.priors;
    for (size_t i = 0; i < priors.size(); ++i) {
      priors[i].dt_ns = NsFromSeconds(kStepS);
      const double bias = kLargestRadS * share_of_step(i);
      priors[i].cam2_from_cam1.rotation =
          ExpSo3(Eigen::Vector3d(0.0, kStepS * bias, 0.0)) *
          priors[i].cam2_from_cam1.rotation;
    }
    return Assess();
  };
  const Verdict drifts =
      add_bias([&](size_t i) { return 2.0 * i / honest.priors.size() - 1.0; });
  ExpectResult(drifts, VerdictResult::kGood, "rotations agree to 100 %");
  EXPECT_LT(drifts.priors[0].chi2_ratio, 1.5);
  ExpectResult(add_bias([](size_t i) { return i % 2 == 0 ? 1.0 : -1.0; }),
               VerdictResult::kFailed, "rotations contradict");
}

// The model has the shape of vision, but its scale contradicts the priors.
TEST_F(VerdictTest, WrongLengthsAreDoubtfulUnlessKeypointsWereLetGo) {
  for (RelativePosePrior& prior : world_.data.priors) {
    prior.cam2_from_cam1.translation *= 2.0;
  }
  ExpectResult(Assess(), VerdictResult::kDoubtful, "translations contradict");
  summary_.refine.keypoint_sigma_factor = 8.0;
  ExpectResult(Assess(), VerdictResult::kFailed, "translations contradict");
  // The accelerometer has made the model half as large: no contradiction.
  for (RelativePosePrior& prior : world_.data.priors) {
    prior.covariance.bottomRightCorner<3, 3>() *= 4.0;
  }
  summary_.refine.keypoint_sigma_factor = 1.0;
  summary_.size_over_priors = 0.5;
  ExpectResult(Assess(), VerdictResult::kGood, "");
}

// A wrong camera-IMU rotation rotates all directions of driving alike, which
// the adjustment estimates.
TEST_F(VerdictTest, DirectionsOffAlikeAreNoContradiction) {
  const SceneData honest = world_.data;
  const auto turn = [&](double angle_rad, bool alike) {
    world_.data = honest;
    double sign = 1.0;
    for (RelativePosePrior& prior : world_.data.priors) {
      prior.cam2_from_cam1.translation =
          ExpSo3(Eigen::Vector3d(0.0, sign * angle_rad, 0.0)) *
          prior.cam2_from_cam1.translation;
      if (!alike) sign = -sign;
    }
    return Assess();
  };
  ExpectResult(turn(0.03, true), VerdictResult::kGood, "");
  ExpectResult(turn(0.03, false), VerdictResult::kDoubtful,
               "translations contradict");
  ExpectResult(turn(0.2, true), VerdictResult::kDoubtful,
               "translations contradict");
}

TEST_F(VerdictTest, LensesOfAnotherKind) {
  const Verdict honest = Assess();
  ASSERT_EQ(honest.lens_errors.size(), 1);
  EXPECT_LT(honest.lens_errors.begin()->second.ratio, 0.1);
  for (const auto& [camera_id, camera] : model_.Cameras()) {
    colmap::Camera& fisheye = model_.Camera(camera_id);
    std::vector<double> params = camera.Params();
    params.resize(8, 0.0);
    fisheye.SetModelIdFromName("OPENCV_FISHEYE");
    fisheye.SetParams(params);
  }
  const Verdict verdict = Assess();
  ExpectResult(verdict, VerdictResult::kDoubtful, "the lens model of camera ");
  const nlohmann::json json = VerdictToJson(verdict);
  ASSERT_EQ(json["lenses"].size(), 1);
  EXPECT_GT(json["lenses"][0]["ratio"], 0.25);
}

TEST_F(VerdictTest, WhatTheStagesSaid) {
  ExpectResult(Assess({"the wheels slip"}), VerdictResult::kDoubtful,
               "an earlier step warned: the wheels slip");
  summary_.refine.num_images_reset = 5;
  ExpectResult(Assess(), VerdictResult::kDoubtful, "5 images contradicted");
  summary_.refine.num_images_reset = 0;
  summary_.parts[0].failure = "a bad point";
  ExpectResult(Assess(), VerdictResult::kDoubtful,
               "parts failed or did not fit");
  summary_.parts[0].failure.clear();
  summary_.is_metric = false;
  ExpectResult(Assess(), VerdictResult::kDoubtful, "no metres");
  // An IMU alone measures no lengths.
  for (RelativePosePrior& prior : world_.data.priors) {
    prior.flags &= ~kPriorLength;
  }
  ExpectResult(Assess(), VerdictResult::kGood, "no metres");
}

TEST_F(VerdictTest, SeveralModelsAreJudgedTogetherAndEachByItself) {
  SceneData rest;
  rest.images[2000].image_id = 2000;
  const AssessedModel sound = {&world_.data, &summary_, &model_};
  MapperStageSummary without_metres = summary_;
  without_metres.is_metric = false;
  const Verdict verdict =
      AssessModels({sound, {&world_.data, &without_metres, &model_}}, rest, {});
  ExpectResult(verdict, VerdictResult::kDoubtful,
               "80 of 81 images, in 2 models");
  ExpectResult(verdict, VerdictResult::kDoubtful,
               "lengths of 1 of 2 models are in no unit");
  EXPECT_FALSE(verdict.is_metric);
  EXPECT_EQ(verdict.num_metric_models, 1);
  EXPECT_EQ(verdict.num_points, 2 * static_cast<int>(model_.NumPoints3D()));
  EXPECT_EQ(verdict.priors[0].num_priors, 2 * 39);

  // One failed model after sound ones makes the verdict doubtful; if failed
  // models have most images, the verdict is failed.
  colmap::Reconstruction without_points = model_;
  for (const colmap::point3D_t point_id : model_.Point3DIds()) {
    without_points.DeletePoint3D(point_id);
  }
  const AssessedModel failed = {&world_.data, &summary_, &without_points};
  const Verdict doubtful = AssessModels({sound, sound, failed}, {}, {});
  ExpectResult(doubtful, VerdictResult::kDoubtful,
               "model 2 of 40 images failed: the model has no points");
  ExpectResult(AssessModels({sound, failed, failed}, {}, {}),
               VerdictResult::kFailed, "model 2 of 40 images failed");
}

TEST_F(VerdictTest, TheLineNamesImagesOfNoModel) {
  Verdict verdict = Assess();
  EXPECT_EQ(FormatVerdict(verdict).find("In no model"), std::string::npos);
  verdict.lost_images = {{7, "dark.png", LostReason::kNoMatches}};
  EXPECT_THAT(FormatVerdict(verdict),
              HasSubstr("In no model: 1 without verified matches (dark.png)"));
}

}  // namespace
}  // namespace adasfm
