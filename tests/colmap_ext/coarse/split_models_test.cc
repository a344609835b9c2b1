// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/split_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "colmap_ext/coarse/join_models.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "tests/testing/colmap_ext/global_stage_run.h"
#include "tests/testing/colmap_ext/inertial_drive.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

// A drive whose first 20 images share no point with the later ones, as after an
// adjustment that found the matches between them wrong.
class SplitModelsTest : public testing::Test {
 protected:
  explicit SplitModelsTest(int num_images = 60)
      : world_(BuildSyntheticWorld(WorldOf(num_images))),
        scene_(BuildSyntheticScene(world_, NoPriors())),
        result_(RunStage(scene_)) {
    bearings_ = ComputeSceneBearings(scene_, 1);
    for (const ScenePair& pair : scene_.pairs) {
      matches_[ImagePair(pair.image_id1, pair.image_id2)] = pair.inlier_matches;
    }
  }

  static SyntheticWorldOptions WorldOf(int num_images) {
    SyntheticWorldOptions options;
    options.num_images = num_images;
    return options;
  }

  static SyntheticPriorOptions NoPriors() {
    SyntheticPriorOptions priors;
    priors.enabled = false;
    return priors;
  }

  std::map<image_t, Rigid3d> TruePoses() const {
    std::map<image_t, Rigid3d> poses;
    for (const SyntheticImage& image : world_.images) {
      poses[image.image_id] = image.cam_from_world;
    }
    return poses;
  }

  bool IsFirst(image_t image_id) const {
    return image_id < world_.images[20].image_id;
  }

  void CutPoints() {
    colmap::Reconstruction& model = result_.models[0].reconstruction;
    const auto ids = model.Point3DIds();
    for (const auto id : std::set<colmap::point3D_t>(ids.begin(), ids.end())) {
      bool is_first = false, is_second = false;
      for (const auto& element : TrackOf(model.Point3D(id)).Elements()) {
        (IsFirst(element.image_id) ? is_first : is_second) = true;
      }
      if (is_first && is_second) model.DeletePoint3D(id);
    }
  }

  int Split() { return SplitModels({}, scene_, bearings_, matches_, &result_); }

  const SyntheticWorld world_;
  SceneData scene_;
  GlobalStageResult result_;
  std::map<image_t, std::vector<Bearing>> bearings_;
  std::map<ImagePair, std::vector<FeatureMatch>> matches_;
};

TEST_F(SplitModelsTest, PartsThatNoPointTiesAreModelsOfTheirOwn) {
  ASSERT_EQ(result_.models.size(), 1);
  EXPECT_EQ(Split(), 0);
  CutPoints();
  EXPECT_EQ(Split(), 1);
  ASSERT_EQ(result_.models.size(), 2);
  ASSERT_EQ(result_.poses.components.size(), 2);
  EXPECT_EQ(result_.models[0].reconstruction.NumRegImages(), 40);
  EXPECT_EQ(result_.models[1].reconstruction.NumRegImages(), 20);
  for (const CoarseModel& model : result_.models) {
    EXPECT_LT(ComputeAlignedErrors(CamsFromWorld(model.reconstruction),
                                   TruePoses(), {})
                  .rmse_m,
              0.1);
  }
  int num_across = 0;
  for (const ViewGraphEdge& edge : result_.poses.graph.edges) {
    if (IsFirst(edge.image_id1) == IsFirst(edge.image_id2)) continue;
    EXPECT_FALSE(edge.IsKept());
    num_across += edge.removal == EdgeRemoval::kUnknownSize;
  }
  EXPECT_GT(num_across, 0);
  // The matches were right here: the parts belong together again.
  EXPECT_EQ(JoinModels({}, scene_, bearings_, matches_, &result_), 1);
  SortModels(&result_);
  ASSERT_EQ(result_.models.size(), 1);
  EXPECT_EQ(result_.models[0].reconstruction.NumRegImages(), 60);
}

TEST_F(SplitModelsTest, ModelsInMetresStayWhole) {
  CutPoints();
  result_.models[0].metric = true;
  EXPECT_EQ(Split(), 0);
  EXPECT_EQ(result_.models.size(), 1);
}

// Long enough for an accelerometer to determine metres.
class SplitByInertiaTest : public SplitModelsTest {
 protected:
  SplitByInertiaTest() : SplitModelsTest(150) {}

  // Shifts the first 20 images by way_m metres.
  void MoveFirst(double way_m) {
    colmap::Reconstruction& model = result_.models[0].reconstruction;
    const double units_per_metre =
        1.0 / ComputeAlignedErrors(CamsFromWorld(model), TruePoses(), {}).scale;
    std::map<image_t, Rigid3d> poses = CamsFromWorld(model);
    for (auto& [image_id, pose] : poses) {
      if (!IsFirst(image_id)) continue;
      pose.translation -=
          pose.rotation * Eigen::Vector3d(way_m * units_per_metre, 0.0, 0.0);
      SetCamFromWorld(pose, &model.Image(image_id));
    }
  }

  // Motions of an IMU at the camera, without errors.
  void AddInertialMotions() {
    std::vector<TimedPose> images;
    for (const SyntheticImage& image : world_.images) {
      images.push_back(
          {image.image_id, image.timestamp_ns, image.cam_from_world});
    }
    scene_.inertial_motions = IntegrateDrive(std::move(images), {});
  }
};

TEST_F(SplitByInertiaTest, TakesAPartOutThatStandsElsewhere) {
  AddInertialMotions();
  EXPECT_EQ(Split(), 0);
  MoveFirst(10.0);
  EXPECT_EQ(Split(), 1);
  ASSERT_EQ(result_.models.size(), 2);
  EXPECT_EQ(result_.models[0].reconstruction.NumRegImages(), 130);
  EXPECT_EQ(result_.models[1].reconstruction.NumRegImages(), 20);
  for (const ViewGraphEdge& edge : result_.poses.graph.edges) {
    EXPECT_FALSE(edge.IsKept() &&
                 IsFirst(edge.image_id1) != IsFirst(edge.image_id2));
  }
  // The matches of the part are right here. They give its true position, which
  // the accelerometer does not contradict.
  EXPECT_EQ(JoinModels({}, scene_, bearings_, matches_, &result_), 1);
  SortModels(&result_);
  ASSERT_EQ(result_.models.size(), 1);
  EXPECT_LT(
      ComputeAlignedErrors(CamsFromWorld(result_.models[0].reconstruction),
                           TruePoses(), {})
          .rmse_m,
      0.1);
}

TEST_F(SplitByInertiaTest, LeavesItWithoutAnAccelerometer) {
  MoveFirst(10.0);
  EXPECT_EQ(Split(), 0);
}

}  // namespace
}  // namespace adasfm
