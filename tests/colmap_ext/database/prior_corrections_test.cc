// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <gtest/gtest.h>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/so3.h"
#include "global/calibration/correct_camera_mount.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using Priors = std::vector<RelativePosePrior>;

Priors Turned(Priors priors, const Eigen::Vector3d& rate_rad_s) {
  for (RelativePosePrior& prior : priors) {
    Eigen::Quaterniond& rotation = prior.cam2_from_cam1.rotation;
    rotation = ExpSo3(SecondsFromNs(prior.dt_ns) * rate_rad_s) * rotation;
  }
  return priors;
}

class PriorCorrectionsTest : public testing::Test {
 protected:
  PriorCorrectionsTest() {
    SyntheticWorldOptions options;
    options.num_images = 6;
    options.num_keypoints_per_image = 50;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world, path_).ok());
    const SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    tables_.priors = scene.priors;
    for (const auto& [image_id, image] : scene.images) {
      tables_.image_times.push_back({image_id, *image.timestamp_ns});
    }
    EXPECT_TRUE(WritePriorTables(path_, tables_).ok());
    corrected_ = Turned(tables_.priors, Eigen::Vector3d(0.01, -0.02, 0.03));
  }

  Priors Read(bool originals = false) const {
    SceneDataOptions options;
    options.use_original_two_view_geometries = originals;
    const StatusOr<SceneData> scene = ReadSceneData(path_, options);
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return scene->priors;
  }

  static void ExpectRotations(const Priors& actual, const Priors& expected) {
    ASSERT_EQ(actual.size(), expected.size());
    for (size_t k = 0; k < actual.size(); ++k) {
      EXPECT_LT(AngleBetweenRad(actual[k].cam2_from_cam1.rotation,
                                expected[k].cam2_from_cam1.rotation),
                1e-9);
      EXPECT_EQ(actual[k].cam2_from_cam1.translation,
                expected[k].cam2_from_cam1.translation);
    }
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  PriorTables tables_;
  Priors corrected_;
};

TEST_F(PriorCorrectionsTest, AreReadUntilTheyAreRestored) {
  ExpectRotations(Read(), tables_.priors);
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {std::nullopt, corrected_}).ok());
  ExpectRotations(Read(), corrected_);
  // A second run of the global stage starts from the import.
  ExpectRotations(Read(true), tables_.priors);
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok());
  EXPECT_TRUE(restored->priors_restored);
  ExpectRotations(Read(), tables_.priors);
  EXPECT_FALSE(RestoreTwoViewGeometries(path_)->priors_restored);
}

TEST_F(PriorCorrectionsTest, TheLastRunCounts) {
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {std::nullopt, corrected_}).ok());
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}).ok());
  ExpectRotations(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, ANewImportRemovesThem) {
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {std::nullopt, corrected_}).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  ExpectRotations(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, FollowTheNamesOfImages) {
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {std::nullopt, corrected_}).ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute(
          "UPDATE adasfm_prior_corrections SET name1 = 'gone' WHERE "
          "image_id1 = " +
          std::to_string(tables_.priors[2].image_id1));
  Priors expected = corrected_;
  expected[2] = tables_.priors[2];
  ExpectRotations(Read(), expected);
}

TEST_F(PriorCorrectionsTest, DamagedRowsAreAnError) {
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {std::nullopt, corrected_}).ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE adasfm_prior_corrections SET qvec = X'0102'");
  EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok());
}

TEST_F(PriorCorrectionsTest, TurnTheCamera) {
  const Eigen::Quaterniond mount = ExpSo3(Eigen::Vector3d(0.01, -0.03, 0.02));
  tables_.gravity = {{tables_.priors[0].image_id1, Eigen::Vector3d::UnitY()}};
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  Priors turned = tables_.priors;
  for (RelativePosePrior& prior : turned) TurnPrior(mount, &prior);
  const auto gravity = [&](bool originals) {
    SceneDataOptions options;
    options.use_original_two_view_geometries = originals;
    return *ReadSceneData(path_, options)
                ->images.at(tables_.priors[0].image_id1)
                .gravity_in_cam;
  };
  const auto expect_turned = [&](const Priors& expected) {
    const Priors actual = Read();
    ASSERT_EQ(actual.size(), expected.size());
    for (size_t k = 0; k < actual.size(); ++k) {
      EXPECT_LT(AngleBetweenRad(actual[k].cam2_from_cam1.rotation,
                                expected[k].cam2_from_cam1.rotation),
                1e-9);
      EXPECT_LT((actual[k].cam2_from_cam1.translation -
                 turned[k].cam2_from_cam1.translation)
                    .norm(),
                1e-9);
      EXPECT_LT((actual[k].covariance - turned[k].covariance).norm(),
                1e-9 * turned[k].covariance.norm());
    }
    EXPECT_LT((gravity(false) - mount * Eigen::Vector3d::UnitY()).norm(), 1e-9);
  };
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, {mount, {}}).ok());
  expect_turned(turned);
  // Corrected rotations are those of turned cameras.
  ASSERT_TRUE(
      RewriteTwoViewGeometries(path_, {}, {}, {mount, corrected_}).ok());
  expect_turned(corrected_);
  EXPECT_EQ(gravity(true), Eigen::Vector3d::UnitY());
  ExpectRotations(Read(true), tables_.priors);
  ASSERT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  EXPECT_EQ(gravity(false), Eigen::Vector3d::UnitY());
  ExpectRotations(Read(), tables_.priors);
}

// A bias of 0.3 deg/s, whose steps of 0.2 s are far beyond their sigmas.
TEST(GlobalStagePriorsTest, AdjustmentUsesTheCorrectedPriors) {
  for (const uint64_t seed : {1, 2}) {
    SyntheticWorldOptions options;
    options.num_images = 60;
    options.seed = seed;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    SceneData scene = BuildSyntheticScene(world, SyntheticPriorOptions());
    const Eigen::Vector3d bias = DegToRad(0.3) * Eigen::Vector3d(0.3, 0.9, 0.3);
    scene.priors = Turned(scene.priors, bias);
    GlobalStageOptions stage;
    // The adjustment would find the bias itself.
    stage.structure.bundle.shared_errors.enabled = false;
    // The import leaves less of a bias as a rule.
    stage.poses.rotation_rates.rate_sigma_rad_s = bias.norm();
    const StatusOr<GlobalStageResult> with = RunGlobalStage(stage, scene);
    stage.poses.rotation_rates.enabled = false;
    const StatusOr<GlobalStageResult> without = RunGlobalStage(stage, scene);
    ASSERT_TRUE(with.ok() && without.ok());
    EXPECT_TRUE(with->poses.rotation_rates.corrected);
    EXPECT_FALSE(without->poses.rotation_rates.corrected);
    // A quarter of the bias may be left, 2.6e-4 rad a step: keypoints of 1e-3
    // rad and a hundred matches a pair give 1e-4, facades more.
    const Priors truth = Turned(scene.priors, -bias);
    for (size_t k = 0; k < truth.size(); ++k) {
      const double dt_s = SecondsFromNs(truth[k].dt_ns);
      EXPECT_LT(AngleBetweenRad(with->poses.priors[k].cam2_from_cam1.rotation,
                                truth[k].cam2_from_cam1.rotation),
                0.25 * dt_s * bias.norm());
    }
    EXPECT_LT(with->models[0].prior_chi2_per_dof,
              without->models[0].prior_chi2_per_dof);
    EXPECT_LE(
        ComparePoses(world, with->models[0].reconstruction).rmse_m,
        1.1 * ComparePoses(world, without->models[0].reconstruction).rmse_m);
  }
}

}  // namespace
}  // namespace adasfm
