// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_tables.h"

#include <gtest/gtest.h>

#include <limits>

#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/random.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class PriorTablesTest : public testing::Test {
 protected:
  PriorTablesTest() {
    SyntheticWorldOptions options;
    options.num_images = 6;
    options.num_keypoints_per_image = 50;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, path_).ok());
  }

  PriorTables MakeTables(uint64_t seed) const {
    Random random(seed);
    PriorTables tables;
    for (const SyntheticImage& image : world_.images) {
      tables.image_times.push_back({image.image_id, image.timestamp_ns});
      tables.gravity.push_back({image.image_id, random.UnitVector()});
    }
    for (size_t i = 1; i < world_.images.size(); ++i) {
      RelativePosePrior prior;
      prior.image_id1 = world_.images[i - 1].image_id;
      prior.image_id2 = world_.images[i].image_id;
      prior.dt_ns =
          world_.images[i].timestamp_ns - world_.images[i - 1].timestamp_ns;
      prior.cam2_from_cam1 = ComputeCam2FromCam1(
          world_.images[i - 1].cam_from_world, world_.images[i].cam_from_world);
      const Eigen::Matrix<double, 6, 6> root =
          Eigen::Matrix<double, 6, 6>::NullaryExpr(
              [&random]() { return random.Gaussian(0.1); });
      prior.covariance = root * root.transpose();
      prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
      tables.priors.push_back(prior);
      PositionPrior position;
      position.image_id1 = prior.image_id1;
      position.image_id2 = i % 2 == 0 ? prior.image_id1 : prior.image_id2;
      position.share = i % 2 == 0 ? 0.0 : random.Uniform(0.0, 1.0);
      position.position = random.GaussianVector(100.0);
      position.covariance =
          root.topLeftCorner<3, 3>() * root.topLeftCorner<3, 3>().transpose() +
          Eigen::Matrix3d::Identity();
      position.antenna_in_cam = random.GaussianVector(1.0);
      tables.positions.push_back(position);
      InertialMotion motion;
      motion.image_id1 = prior.image_id1;
      motion.image_id2 = prior.image_id2;
      motion.dt_s = random.Uniform(0.05, 0.5);
      motion.delta_velocity = random.GaussianVector(1.0);
      motion.delta_position = random.GaussianVector(0.1);
      motion.velocity_by_bias = root.topRightCorner<3, 3>();
      motion.position_by_bias = root.bottomLeftCorner<3, 3>();
      motion.camera_from_imu_origin = random.GaussianVector(0.2);
      tables.priors.back().rotation_by_time_shift = random.GaussianVector(0.1);
      tables.priors.back().translation_by_time_shift =
          random.GaussianVector(1.0);
      motion.velocity_by_time_shift = random.GaussianVector(1.0);
      motion.position_by_time_shift = random.GaussianVector(1.0);
      motion.translation_by_time_shift =
          tables.priors.back().translation_by_time_shift;
      if (tables.inertial_motions.size() % 2 == 0) {
        motion.by_wheels =
            MeasuredTranslation{random.GaussianVector(1.0),
                                root.topLeftCorner<3, 3>() *
                                    root.topLeftCorner<3, 3>().transpose()};
      }
      tables.inertial_motions.push_back(motion);
    }
    tables.position_origin = GeodeticPosition{
        random.Uniform(-90.0, 90.0), random.Uniform(-180.0, 180.0), 512.3};
    const Eigen::Matrix3d root = Eigen::Matrix3d::NullaryExpr(
        [&random]() { return random.Gaussian(1e-3); });
    tables.gyroscope_bias_covariance = root * root.transpose();
    tables.length_drift_ratio = random.Uniform(0.001, 0.1);
    tables.wheel_scale = WheelScale{random.Uniform(0.98, 1.02),
                                    random.Uniform(0.001, 0.01), 0.01};
    // The last prior has no translation.
    RelativePosePrior& last = tables.priors.back();
    last.flags = kPriorRotation;
    last.covariance.bottomRows<3>().setZero();
    last.covariance.rightCols<3>().setZero();
    last.covariance.diagonal().tail<3>().setConstant(
        std::numeric_limits<double>::infinity());
    return tables;
  }

  // The scene of the last tables, before and after adasfm_global.
  void ExpectScene(bool has_lengths);

  void Execute(const std::string& sql) {
    SqliteConnection(path_, SqliteConnection::Mode::kWrite).Execute(sql);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  SyntheticWorld world_;
};

void ExpectEqual(const PriorTables& a, const PriorTables& b) {
  ASSERT_EQ(a.image_times.size(), b.image_times.size());
  for (size_t i = 0; i < a.image_times.size(); ++i) {
    EXPECT_EQ(a.image_times[i].image_id, b.image_times[i].image_id);
    EXPECT_EQ(a.image_times[i].timestamp_ns, b.image_times[i].timestamp_ns);
  }
  ASSERT_EQ(a.priors.size(), b.priors.size());
  for (size_t i = 0; i < a.priors.size(); ++i) {
    EXPECT_EQ(a.priors[i].image_id1, b.priors[i].image_id1);
    EXPECT_EQ(a.priors[i].image_id2, b.priors[i].image_id2);
    EXPECT_EQ(a.priors[i].dt_ns, b.priors[i].dt_ns);
    EXPECT_EQ(a.priors[i].flags, b.priors[i].flags);
    EXPECT_EQ(a.priors[i].covariance, b.priors[i].covariance);
    EXPECT_EQ(a.priors[i].rotation_by_time_shift,
              b.priors[i].rotation_by_time_shift);
    EXPECT_EQ(a.priors[i].translation_by_time_shift,
              b.priors[i].translation_by_time_shift);
    EXPECT_EQ(a.priors[i].cam2_from_cam1.translation,
              b.priors[i].cam2_from_cam1.translation);
    EXPECT_LT((a.priors[i].cam2_from_cam1.rotation.coeffs() -
               b.priors[i].cam2_from_cam1.rotation.coeffs())
                  .norm(),
              1e-15);
  }
  ASSERT_EQ(a.gravity.size(), b.gravity.size());
  for (size_t i = 0; i < a.gravity.size(); ++i) {
    EXPECT_EQ(a.gravity[i].image_id, b.gravity[i].image_id);
    EXPECT_EQ(a.gravity[i].gravity_in_cam, b.gravity[i].gravity_in_cam);
  }
  ASSERT_EQ(a.positions.size(), b.positions.size());
  for (size_t i = 0; i < a.positions.size(); ++i) {
    EXPECT_EQ(a.positions[i].image_id1, b.positions[i].image_id1);
    EXPECT_EQ(a.positions[i].image_id2, b.positions[i].image_id2);
    EXPECT_EQ(a.positions[i].share, b.positions[i].share);
    EXPECT_EQ(a.positions[i].position, b.positions[i].position);
    EXPECT_EQ(a.positions[i].covariance, b.positions[i].covariance);
    EXPECT_EQ(a.positions[i].antenna_in_cam, b.positions[i].antenna_in_cam);
  }
  ASSERT_EQ(a.inertial_motions.size(), b.inertial_motions.size());
  for (size_t i = 0; i < a.inertial_motions.size(); ++i) {
    const InertialMotion& motion1 = a.inertial_motions[i];
    const InertialMotion& motion2 = b.inertial_motions[i];
    EXPECT_EQ(motion1.image_id1, motion2.image_id1);
    EXPECT_EQ(motion1.image_id2, motion2.image_id2);
    EXPECT_EQ(motion1.dt_s, motion2.dt_s);
    EXPECT_EQ(motion1.delta_velocity, motion2.delta_velocity);
    EXPECT_EQ(motion1.delta_position, motion2.delta_position);
    EXPECT_EQ(motion1.velocity_by_bias, motion2.velocity_by_bias);
    EXPECT_EQ(motion1.position_by_bias, motion2.position_by_bias);
    EXPECT_EQ(motion1.camera_from_imu_origin, motion2.camera_from_imu_origin);
    ASSERT_EQ(motion1.by_wheels.has_value(), motion2.by_wheels.has_value());
    if (!motion1.by_wheels) continue;
    EXPECT_EQ(motion1.by_wheels->translation, motion2.by_wheels->translation);
    EXPECT_EQ(motion1.by_wheels->covariance, motion2.by_wheels->covariance);
  }
  EXPECT_EQ(a.gyroscope_bias_covariance, b.gyroscope_bias_covariance);
  EXPECT_EQ(a.length_drift_ratio, b.length_drift_ratio);
  ASSERT_EQ(a.wheel_scale.has_value(), b.wheel_scale.has_value());
  if (a.wheel_scale) {
    EXPECT_EQ(a.wheel_scale->scale, b.wheel_scale->scale);
    EXPECT_EQ(a.wheel_scale->sigma, b.wheel_scale->sigma);
    EXPECT_EQ(a.wheel_scale->stated_sigma, b.wheel_scale->stated_sigma);
  }
  ASSERT_EQ(a.position_origin.has_value(), b.position_origin.has_value());
  if (!a.position_origin) return;
  EXPECT_EQ(a.position_origin->latitude_deg, b.position_origin->latitude_deg);
  EXPECT_EQ(a.position_origin->longitude_deg, b.position_origin->longitude_deg);
  EXPECT_EQ(a.position_origin->height_m, b.position_origin->height_m);
}

TEST_F(PriorTablesTest, WithoutTablesThereIsNothing) {
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok());
  EXPECT_TRUE(loaded->tables.priors.empty());
  EXPECT_TRUE(loaded->tables.image_times.empty());
}

TEST_F(PriorTablesTest, ReadsWhatWasWrittenLast) {
  for (const uint64_t seed : {1, 2, 3}) {
    const PriorTables tables = MakeTables(seed);
    const Status written = WritePriorTables(path_, tables);
    ASSERT_TRUE(written.ok()) << written.message();
    const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
    ASSERT_TRUE(loaded.ok()) << loaded.status().message();
    EXPECT_EQ(loaded->num_ignored_rows, 0);
    ExpectEqual(loaded->tables, tables);
  }
  // After adasfm_global motions are used if a length was measured.
  for (const bool has_lengths : {true, false}) {
    if (!has_lengths) {
      Execute("UPDATE adasfm_relative_pose_priors SET flags = 1");
    }
    ExpectScene(has_lengths);
  }
}

void PriorTablesTest::ExpectScene(bool has_lengths) {
  for (const bool is_before_global : {false, true}) {
    SceneDataOptions options;
    options.use_original_two_view_geometries = is_before_global;
    const StatusOr<SceneData> scene = ReadSceneData(path_, options);
    ASSERT_TRUE(scene.ok());
    EXPECT_EQ(scene->priors.size(), 5);
    EXPECT_EQ(scene->images.at(2).timestamp_ns, world_.images[1].timestamp_ns);
    EXPECT_TRUE(scene->images.at(2).gravity_in_cam.has_value());
    EXPECT_TRUE(scene->gyroscope_bias_covariance.has_value());
    EXPECT_GT(scene->length_drift_ratio, 0.0);
    EXPECT_TRUE(scene->wheel_scale.has_value());
    EXPECT_EQ(scene->inertial_motions.size(),
              is_before_global || has_lengths ? 5 : 0);
    EXPECT_EQ(scene->inertial_scale_sigma, 0.0);
  }
}

// Of our tables only adasfm_meta stays, without the position origin.
TEST_F(PriorTablesTest, RemovesAllThatItWrote) {
  PriorTables tables = MakeTables(1);
  tables.rig_cameras[1] = {1, true, Rigid3d()};
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  SqliteConnection database(path_, SqliteConnection::Mode::kWrite);
  WritePriorCorrections(
      {{{1, Eigen::Quaterniond::Identity()}},
       {{1, 0.004}},
       {{1, Eigen::Vector3d(0.01, 0.0, 0.0)}},
       {{tables.priors[0].image_id1, tables.priors[0].image_id2, 1.0}}},
      &database);
  RemovePriorTables(&database);
  SqliteStatement names(&database,
                        "SELECT name FROM sqlite_master WHERE type = 'table' "
                        "AND name LIKE 'adasfm%'");
  while (names.Step()) EXPECT_EQ(names.Text(0), "adasfm_meta");
  SqliteStatement origin(
      &database, "SELECT * FROM adasfm_meta WHERE key = 'position_origin'");
  EXPECT_FALSE(origin.Step());
}

// Databases written before shared errors existed, or without a gyroscope.
TEST_F(PriorTablesTest, DatabasesWithoutSharedErrorsAreRead) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  Execute(
      "DROP TABLE adasfm_gyroscope_bias; DROP TABLE adasfm_length_drift;"
      "DROP TABLE adasfm_wheel_scale;");
  tables.gyroscope_bias_covariance.reset();
  tables.length_drift_ratio = 0.0;
  tables.wheel_scale.reset();
  StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ExpectEqual(loaded->tables, tables);
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(2)).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok());
  ExpectEqual(loaded->tables, tables);
}

// Databases written before the clock was an unknown, or without an IMU.
TEST_F(PriorTablesTest, DatabasesWithoutTimeShiftEffectsAreRead) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  Execute("DROP TABLE adasfm_time_shift_effects;");
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  for (RelativePosePrior& prior : tables.priors) {
    prior.rotation_by_time_shift = prior.translation_by_time_shift = zero;
  }
  for (InertialMotion& motion : tables.inertial_motions) {
    motion.velocity_by_time_shift = motion.position_by_time_shift =
        motion.translation_by_time_shift = zero;
  }
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ExpectEqual(loaded->tables, tables);
}

// Databases written before inertial motions existed, or without them.
TEST_F(PriorTablesTest, DatabasesWithoutInertialMotionsAreRead) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  Execute("DROP TABLE adasfm_inertial_motions;");
  tables.inertial_motions.clear();
  StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ExpectEqual(loaded->tables, tables);
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(2)).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok());
  ExpectEqual(loaded->tables, tables);
}

// Databases written when only drives without wheels had inertial motions.
TEST_F(PriorTablesTest, InertialMotionsWithoutWheelsAreRead) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  Execute(
      "ALTER TABLE adasfm_inertial_motions DROP COLUMN wheel_translation;"
      "ALTER TABLE adasfm_inertial_motions DROP COLUMN wheel_covariance;");
  for (InertialMotion& motion : tables.inertial_motions) {
    motion.by_wheels.reset();
  }
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ExpectEqual(loaded->tables, tables);
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(2)).ok());
}

// Two robots that drive at the same time: priors are read drive by drive, as
// consecutive motions share errors along one drive.
TEST_F(PriorTablesTest, DrivesAtTheSameTimeFollowEachOther) {
  PriorTables tables = MakeTables(1);
  const RelativePosePrior prior = tables.priors.front();
  tables.priors.clear();
  for (const ImagePair& pair :
       {ImagePair(1, 3), ImagePair(2, 4), ImagePair(3, 5), ImagePair(4, 6)}) {
    tables.priors.push_back(prior);
    tables.priors.back().image_id1 = pair.image_id1;
    tables.priors.back().image_id2 = pair.image_id2;
  }
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  std::vector<image_t> firsts;
  for (const RelativePosePrior& read : loaded->tables.priors) {
    firsts.push_back(read.image_id1);
  }
  EXPECT_EQ(firsts, (std::vector<image_t>{1, 3, 2, 4}));
}

// Databases written before positions existed, or without them.
TEST_F(PriorTablesTest, DatabasesWithoutPositionsAreRead) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  Execute(
      "DROP TABLE adasfm_position_priors;"
      "DELETE FROM adasfm_meta WHERE key = 'position_origin';");
  tables.positions.clear();
  tables.position_origin.reset();
  StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  ExpectEqual(loaded->tables, tables);
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(2)).ok());
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok());
  ExpectEqual(loaded->tables, tables);
}

TEST_F(PriorTablesTest, UserVersionStays) {
  Execute("PRAGMA user_version = 3800;");
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(1)).ok());
  SqliteConnection database(path_, SqliteConnection::Mode::kRead);
  SqliteStatement statement(&database, "PRAGMA user_version");
  ASSERT_TRUE(statement.Step());
  EXPECT_EQ(statement.Int(0), 3800);
}

TEST_F(PriorTablesTest, UnknownImageLeavesTheDatabaseAsItWas) {
  PriorTables tables = MakeTables(1);
  ASSERT_TRUE(WritePriorTables(path_, tables).ok());
  const std::string before = ReadBytes(path_);
  tables.gravity.back().image_id = 77;
  EXPECT_FALSE(WritePriorTables(path_, tables).ok());
  EXPECT_EQ(ReadBytes(path_), before);
}

TEST_F(PriorTablesTest, NamesDecideWhenIdsChange) {
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(1)).ok());
  // As after a merge: image 3 has become 103, image 6 is gone.
  Execute(
      "PRAGMA foreign_keys = OFF;"
      "UPDATE images SET image_id = 103 WHERE image_id = 3;"
      "DELETE FROM images WHERE image_id = 6;");
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(path_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  // Of image 6: time, gravity, one prior, one position, one inertial motion.
  EXPECT_EQ(loaded->num_ignored_rows, 5);
  ASSERT_EQ(loaded->tables.inertial_motions.size(), 4);
  EXPECT_EQ(loaded->tables.inertial_motions[1].image_id2, 103);
  EXPECT_EQ(loaded->tables.inertial_motions[2].image_id1, 103);
  EXPECT_EQ(loaded->tables.positions.size(), 4);
  EXPECT_EQ(loaded->tables.positions[2].image_id1, 103);
  ASSERT_EQ(loaded->tables.priors.size(), 4);
  EXPECT_EQ(loaded->tables.priors[1].image_id2, 103);
  EXPECT_EQ(loaded->tables.priors[2].image_id1, 103);
  EXPECT_EQ(loaded->tables.image_times[2].image_id, 103);
}

TEST_F(PriorTablesTest, RefusesRowsItCouldNotHaveWritten) {
  const char* statements[] = {
      "UPDATE adasfm_meta SET value = '2' WHERE key = 'schema_version';",
      "UPDATE adasfm_relative_pose_priors SET qvec = zeroblob(32);",
      "UPDATE adasfm_relative_pose_priors SET tvec = zeroblob(23);",
      "UPDATE adasfm_relative_pose_priors SET flags = 1024;",
      // Lengths that adasfm_global found are in a table of their own.
      "UPDATE adasfm_relative_pose_priors SET flags = flags | 16;",
      "UPDATE adasfm_relative_pose_priors SET dt_ns = -1;",
      "UPDATE adasfm_gravity SET gravity_in_cam = zeroblob(24);",
      "DELETE FROM adasfm_image_times WHERE image_id = 2;",
      "UPDATE adasfm_position_priors SET share = 1.5;",
      "UPDATE adasfm_position_priors SET covariance = zeroblob(72);",
      "UPDATE adasfm_position_priors SET position = zeroblob(23);",
      "UPDATE adasfm_meta SET value = 'here' WHERE key = 'position_origin';",
      "UPDATE adasfm_gyroscope_bias SET covariance = zeroblob(72);",
      "UPDATE adasfm_gyroscope_bias SET covariance = zeroblob(71);",
      "UPDATE adasfm_length_drift SET sigma_ratio = -0.01;",
      "UPDATE adasfm_wheel_scale SET scale = 0.0;",
      "UPDATE adasfm_wheel_scale SET stated_sigma = 9e999;",
      "UPDATE adasfm_time_shift_effects SET rotation = zeroblob(23);",
      "UPDATE adasfm_time_shift_effects SET delta_position = "
      "X'FFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFF';",
      "UPDATE adasfm_inertial_motions SET dt_s = 0.0;",
      "UPDATE adasfm_inertial_motions SET dt_s = 9e999;",
      "UPDATE adasfm_inertial_motions SET delta_velocity = zeroblob(23);",
      "UPDATE adasfm_inertial_motions SET position_by_bias = zeroblob(24);",
      // Not a number.
      "UPDATE adasfm_inertial_motions SET delta_position = "
      "X'FFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFF';",
  };
  ASSERT_TRUE(WritePriorTables(path_, MakeTables(1)).ok());
  const std::string original = ReadBytes(path_);
  for (const char* statement : statements) {
    folder_.Write("database.db", original);
    Execute(statement);
    EXPECT_FALSE(ReadPriorTables(path_).ok()) << statement;
    EXPECT_FALSE(ReadSceneData(path_, SceneDataOptions()).ok()) << statement;
  }
}

}  // namespace
}  // namespace adasfm
