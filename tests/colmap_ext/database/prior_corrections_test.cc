// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <gtest/gtest.h>

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
    corrected_ = tables_.priors;
    for (RelativePosePrior& prior : corrected_) TurnPrior(mount_, &prior);
  }

  Priors Read(bool originals = false) const {
    SceneDataOptions options;
    options.use_original_two_view_geometries = originals;
    const StatusOr<SceneData> scene = ReadSceneData(path_, options);
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return scene->priors;
  }

  static void ExpectPriors(const Priors& actual, const Priors& expected) {
    ASSERT_EQ(actual.size(), expected.size());
    for (size_t k = 0; k < actual.size(); ++k) {
      EXPECT_LT(AngleBetweenRad(actual[k].cam2_from_cam1.rotation,
                                expected[k].cam2_from_cam1.rotation),
                1e-9);
      EXPECT_LT((actual[k].cam2_from_cam1.translation -
                 expected[k].cam2_from_cam1.translation)
                    .norm(),
                1e-9);
      EXPECT_LT((actual[k].covariance - expected[k].covariance).norm(),
                1e-9 * expected[k].covariance.norm());
    }
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  PriorTables tables_;
  const Eigen::Quaterniond mount_ = ExpSo3(Eigen::Vector3d(0.01, -0.03, 0.02));
  Priors corrected_;
};

TEST_F(PriorCorrectionsTest, AreReadUntilTheyAreRestored) {
  ExpectPriors(Read(), tables_.priors);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, mount_).ok());
  ExpectPriors(Read(), corrected_);
  // A second run of the global stage starts from the import.
  ExpectPriors(Read(true), tables_.priors);
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok());
  EXPECT_TRUE(restored->priors_restored);
  ExpectPriors(Read(), tables_.priors);
  EXPECT_FALSE(RestoreTwoViewGeometries(path_)->priors_restored);
}

TEST_F(PriorCorrectionsTest, TheLastRunCounts) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, mount_).ok());
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}).ok());
  ExpectPriors(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, ANewImportRemovesThem) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, mount_).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  ExpectPriors(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, DamagedRowsAreAnError) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, mount_).ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE adasfm_camera_mount SET qvec = X'0102'");
  EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok());
}

TEST_F(PriorCorrectionsTest, TurnGravityToo) {
  const image_t image_id = tables_.priors[0].image_id1;
  tables_.gravity = {{image_id, Eigen::Vector3d::UnitY()}};
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  const auto gravity = [&](bool originals) {
    SceneDataOptions options;
    options.use_original_two_view_geometries = originals;
    return *ReadSceneData(path_, options)->images.at(image_id).gravity_in_cam;
  };
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, mount_).ok());
  EXPECT_LT((gravity(false) - mount_ * Eigen::Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_EQ(gravity(true), Eigen::Vector3d::UnitY());
  ASSERT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  EXPECT_EQ(gravity(false), Eigen::Vector3d::UnitY());
}

}  // namespace
}  // namespace adasfm
