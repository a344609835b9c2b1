// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_corrections.h"

#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/so3.h"
#include "core/sqlite.h"
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
    for (RelativePosePrior& prior : corrected_)
      RotatePrior(correction_, &prior);
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
  const Eigen::Quaterniond correction_ =
      ExpSo3(Eigen::Vector3d(0.01, -0.03, 0.02));
  const PriorCorrections corrections_ = {{{1, correction_}}, {}, {}, {}};
  Priors corrected_;
};

TEST_F(PriorCorrectionsTest, AreReadUntilTheyAreRestored) {
  ExpectPriors(Read(), tables_.priors);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  ExpectPriors(Read(), corrected_);
  // A second run of the global stage starts from the import.
  ExpectPriors(Read(true), tables_.priors);
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok());
  EXPECT_TRUE(restored->priors_restored);
  ExpectPriors(Read(), tables_.priors);
  EXPECT_FALSE(RestoreTwoViewGeometries(path_)->priors_restored);
}

TEST_F(PriorCorrectionsTest, OlderTablesHaveOneForAllCameras) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("ALTER TABLE adasfm_camera_mount DROP COLUMN camera_id");
  ExpectPriors(Read(), corrected_);
}

// The second half of the images has a camera of its own, and no prior leads
// there: another machine, whose T_cam_imu is right.
TEST_F(PriorCorrectionsTest, AreThoseOfTheCamerasDrive) {
  const image_t last = tables_.priors[2].image_id1;
  tables_.priors.erase(tables_.priors.begin() + 2);
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute(
          "INSERT INTO cameras SELECT 2, model, width, height, params, "
          "prior_focal_length FROM cameras WHERE camera_id = 1;"
          "UPDATE images SET camera_id = 2 WHERE image_id > " +
          std::to_string(last));
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  Priors expected = tables_.priors;
  for (size_t k = 0; k < 2; ++k) RotatePrior(correction_, &expected[k]);
  const Priors read = Read();
  ExpectPriors(read, expected);
  for (size_t k = 0; k < read.size(); ++k)
    EXPECT_EQ(read[k].drive, k < 2 ? 0 : 1);
}

TEST_F(PriorCorrectionsTest, TheLastRunCounts) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}).ok());
  ExpectPriors(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, ANewImportRemovesThem) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  ExpectPriors(Read(), tables_.priors);
}

TEST_F(PriorCorrectionsTest, DamagedRowsAreAnError) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
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
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  EXPECT_LT((gravity(false) - correction_ * Eigen::Vector3d::UnitY()).norm(),
            1e-9);
  EXPECT_EQ(gravity(true), Eigen::Vector3d::UnitY());
  ASSERT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  EXPECT_EQ(gravity(false), Eigen::Vector3d::UnitY());
}

// A clock that is off: rotations, translations and inertial motions follow to
// first order, in the frame of a rotated camera, too.
TEST_F(PriorCorrectionsTest, ShiftTheTime) {
  constexpr double kShiftS = 0.007;
  for (size_t k = 0; k < tables_.priors.size(); ++k) {
    RelativePosePrior& prior = tables_.priors[k];
    prior.rotation_by_time_shift << 0.1, -0.2, 0.05 * (k + 1);
    prior.translation_by_time_shift << 1.0, 2.0, -3.0;
    InertialMotion motion;
    motion.image_id1 = prior.image_id1;
    motion.image_id2 = prior.image_id2;
    motion.dt_s = 0.1;
    motion.velocity_by_time_shift << -4.0, 5.0, 6.0;
    motion.position_by_time_shift << 0.7, 0.8, -0.9;
    motion.by_wheels = MeasuredTranslation();
    tables_.inertial_motions.push_back(motion);
  }
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  PriorCorrections corrections = corrections_;
  corrections.time_shift_s[1] = kShiftS;
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections).ok());
  Priors expected = tables_.priors;
  for (RelativePosePrior& prior : expected) {
    Rigid3d& motion = prior.cam2_from_cam1;
    motion.rotation =
        ExpSo3(kShiftS * prior.rotation_by_time_shift) * motion.rotation;
    motion.translation += kShiftS * prior.translation_by_time_shift;
    RotatePrior(correction_, &prior);
  }
  ExpectPriors(Read(), expected);
  ExpectPriors(Read(true), tables_.priors);
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok());
  ASSERT_EQ(scene->inertial_motions.size(), tables_.priors.size());
  const InertialMotion& motion = scene->inertial_motions.front();
  const auto expect_vector = [&](const Eigen::Vector3d& actual, double x,
                                 double y, double z) {
    EXPECT_LT(
        (actual - kShiftS * (correction_ * Eigen::Vector3d(x, y, z))).norm(),
        1e-12);
  };
  expect_vector(motion.delta_velocity, -4.0, 5.0, 6.0);
  expect_vector(motion.delta_position, 0.7, 0.8, -0.9);
  expect_vector(motion.by_wheels->translation, 1.0, 2.0, -3.0);
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE adasfm_time_shifts SET shift_s = 9e999");
  EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok());
  EXPECT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  ExpectPriors(Read(), tables_.priors);
}

// Rates are corrected in the true frame of the camera.
TEST_F(PriorCorrectionsTest, GyroscopeScalesCorrectThePriors) {
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  const Eigen::Vector3d scales(0.01, -0.02, 0.005);
  PriorCorrections corrections = corrections_;
  corrections.gyroscope_scales[1] = scales;
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections).ok());
  Priors expected = tables_.priors;
  for (RelativePosePrior& prior : expected) {
    RotatePrior(correction_, &prior);
    CorrectGyroscopeScales(scales, &prior);
  }
  ExpectPriors(Read(), expected);
  ExpectPriors(Read(true), tables_.priors);
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE adasfm_gyroscope_scales SET scales = zeroblob(8)");
  EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok());
  EXPECT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  ExpectPriors(Read(), tables_.priors);
}

// Priors of an IMU without wheels, except for the last one.
class InertialLengthsTest : public PriorCorrectionsTest {
 protected:
  InertialLengthsTest() {
    for (size_t k = 0; k < tables_.priors.size(); ++k) {
      RelativePosePrior& prior = tables_.priors[k];
      lengths_.push_back(
          {prior.image_id1, prior.image_id2, 1.0 + k, 0.1, 0.01 * (k + 1)});
      if (k == kBridge) lengths_.back().bridge = Bridge();
      if (k + 1 == tables_.priors.size()) break;
      prior.flags = kPriorRotation;
      prior.covariance.bottomRows<3>().setZero();
      prior.covariance.rightCols<3>().setZero();
      prior.covariance.diagonal().tail<3>().setConstant(
          std::numeric_limits<double>::infinity());
    }
    EXPECT_TRUE(WritePriorTables(path_, tables_).ok());
  }

  static MeasuredTranslation Bridge() {
    MeasuredTranslation bridge;
    bridge.translation << 0.1, -0.2, 1.5;
    bridge.covariance << 4.0, 0.5, 0.1, 0.5, 3.0, -0.2, 0.1, -0.2, 5.0;
    return bridge;
  }

  Status Rewrite(PriorCorrections corrections = {}) const {
    corrections.lengths = lengths_;
    return RewriteTwoViewGeometries(path_, {}, {}, corrections);
  }

  // Whether the priors have the inertial lengths.
  bool AreApplied() const {
    const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    EXPECT_EQ(scene->priors[0].HasLength(), scene->inertial_scale_sigma > 0.0);
    return scene->priors[0].HasLength();
  }

  // The index of the prior across a gap.
  static constexpr size_t kBridge = 1;
  std::vector<InertialLength> lengths_;
};

TEST_F(InertialLengthsTest, AreReadAsWritten) {
  ASSERT_TRUE(Rewrite().ok());
  SqliteConnection database(path_, SqliteConnection::Mode::kRead);
  const std::vector<InertialLength> read = ReadInertialLengths(&database);
  ASSERT_EQ(read.size(), lengths_.size());
  for (size_t k = 0; k < read.size(); ++k) {
    EXPECT_EQ(read[k].image_id1, lengths_[k].image_id1);
    EXPECT_EQ(read[k].image_id2, lengths_[k].image_id2);
    EXPECT_EQ(read[k].length_m, lengths_[k].length_m);
    EXPECT_EQ(read[k].sigma_m, lengths_[k].sigma_m);
    EXPECT_EQ(read[k].scale_sigma, lengths_[k].scale_sigma);
    ASSERT_EQ(read[k].bridge.has_value(), k == kBridge);
  }
  EXPECT_EQ(read[kBridge].bridge->translation, Bridge().translation);
  EXPECT_EQ(read[kBridge].bridge->covariance, Bridge().covariance);
}

TEST_F(InertialLengthsTest, OlderTablesHaveNoBridges) {
  ASSERT_TRUE(Rewrite().ok());
  SqliteConnection database(path_, SqliteConnection::Mode::kWrite);
  database.Execute(
      "ALTER TABLE adasfm_inertial_lengths DROP COLUMN bridge_translation;"
      "ALTER TABLE adasfm_inertial_lengths DROP COLUMN bridge_covariance;");
  const std::vector<InertialLength> read = ReadInertialLengths(&database);
  ASSERT_EQ(read.size(), lengths_.size());
  EXPECT_EQ(read[kBridge].length_m, lengths_[kBridge].length_m);
  EXPECT_FALSE(read[kBridge].bridge);
}

TEST_F(InertialLengthsTest, GoToPriorsWithoutLength) {
  ASSERT_TRUE(Rewrite(corrections_).ok());
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  for (size_t k = 0; k + 1 < lengths_.size(); ++k) {
    const RelativePosePrior& prior = scene->priors[k];
    EXPECT_LT(AngleBetweenRad(prior.cam2_from_cam1.rotation,
                              corrected_[k].cam2_from_cam1.rotation),
              1e-9);
    EXPECT_EQ(prior.HasOwnLength(), k == kBridge);
    if (k == kBridge) {
      EXPECT_TRUE(prior.HasMotion());
      EXPECT_EQ(prior.cam2_from_cam1.translation, Bridge().translation);
      EXPECT_EQ(Eigen::Matrix3d(prior.covariance.bottomRightCorner<3, 3>()),
                Bridge().covariance);
      continue;
    }
    EXPECT_EQ(prior.flags, static_cast<uint32_t>(kPriorRotation | kPriorLength |
                                                 kPriorInertialLength));
    EXPECT_EQ(prior.cam2_from_cam1.translation,
              lengths_[k].length_m * Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(prior.covariance(5, 5), 0.01, 1e-12);
  }
  // The last prior keeps its own length.
  EXPECT_EQ(scene->priors.back().flags, tables_.priors.back().flags);
  EXPECT_LT((scene->priors.back().cam2_from_cam1.translation -
             corrected_.back().cam2_from_cam1.translation)
                .norm(),
            1e-9);
  EXPECT_EQ(scene->inertial_scale_sigma,
            lengths_[lengths_.size() - 2].scale_sigma);
  // A second run of the global stage starts from the import.
  const Priors originals = Read(true);
  for (size_t k = 0; k < originals.size(); ++k) {
    EXPECT_EQ(originals[k].flags, tables_.priors[k].flags);
  }
}

TEST_F(InertialLengthsTest, StayUntilTheyAreReplaced) {
  ASSERT_TRUE(Rewrite().ok());
  EXPECT_TRUE(AreApplied());
  ASSERT_TRUE(RestoreTwoViewGeometries(path_)->priors_restored);
  EXPECT_FALSE(AreApplied());
  ASSERT_TRUE(Rewrite(corrections_).ok());
  EXPECT_TRUE(AreApplied());
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, {}, {}, corrections_).ok());
  EXPECT_FALSE(AreApplied());
  ASSERT_TRUE(Rewrite().ok());
  ASSERT_TRUE(WritePriorTables(path_, tables_).ok());
  EXPECT_FALSE(AreApplied());
  SqliteConnection database(path_, SqliteConnection::Mode::kRead);
  EXPECT_FALSE(HasPriorCorrections(&database));
}

TEST_F(InertialLengthsTest, AreMatchedByName) {
  ASSERT_TRUE(Rewrite().ok());
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute(
          "PRAGMA foreign_keys = OFF;"
          "UPDATE images SET image_id = 103 WHERE image_id = 3;"
          "DELETE FROM images WHERE image_id = 5;");
  SqliteConnection database(path_, SqliteConnection::Mode::kRead);
  const std::vector<InertialLength> read = ReadInertialLengths(&database);
  ASSERT_EQ(read.size(), lengths_.size() - 2);
  EXPECT_EQ(read[1].image_id2, 103);
  EXPECT_EQ(read[2].image_id1, 103);
}

TEST_F(InertialLengthsTest, DamagedRowsAreAnError) {
  for (const char* column :
       {"sigma_m = 0.0", "length_m = -1.0", "length_m = 9e999",
        "scale_sigma = -0.1", "bridge_covariance = zeroblob(71)",
        "bridge_translation = zeroblob(23)"}) {
    ASSERT_TRUE(Rewrite().ok());
    SqliteConnection(path_, SqliteConnection::Mode::kWrite)
        .Execute(std::string("UPDATE adasfm_inertial_lengths SET ") + column);
    EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok()) << column;
  }
}

}  // namespace
}  // namespace adasfm
