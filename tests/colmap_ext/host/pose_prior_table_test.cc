// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/pose_prior_table.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "colmap_ext/io/double_blob.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class PosePriorTableTest : public testing::Test {
 protected:
  PosePriorTableTest() { folder_.Write("database.db", ""); }

  SqliteConnection Open() {
    return SqliteConnection(folder_.File("database.db"),
                            SqliteConnection::Mode::kWrite);
  }

  TemporaryFolder folder_;
};

constexpr char kTable4[] =
    "CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL, "
    "corr_data_id INTEGER NOT NULL, corr_sensor_id INTEGER NOT NULL, "
    "corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance "
    "BLOB, gravity BLOB, coordinate_system INTEGER NOT NULL);"
    "CREATE UNIQUE INDEX pose_prior_data_assignment ON "
    "pose_priors(corr_data_id, corr_sensor_id, corr_sensor_type);";

TEST_F(PosePriorTableTest, WhatIsWrittenIsReadAndReplaced) {
  SqliteConnection database = Open();
  EXPECT_FALSE(HasPosePriorTable(&database));
  database.Execute(kTable4);
  ASSERT_TRUE(HasPosePriorTable(&database));
  NewPosePrior prior;
  prior.camera_id = 3;
  for (int run = 1; run <= 2; ++run) {
    std::vector<NewPosePrior> priors;
    for (const image_t id : {7, 9}) {
      prior.image_id = id;
      prior.position = Eigen::Vector3d(run, id, 0.5);
      prior.covariance = 2.0 * run * Eigen::Matrix3d::Identity();
      if (id == 9) prior.gravity_in_cam = Eigen::Vector3d::UnitY();
      priors.push_back(prior);
    }
    WritePosePriors(priors, &database);
    const std::vector<HostPosition> read = ReadHostPositions(&database);
    ASSERT_EQ(read.size(), 2u);
    EXPECT_EQ(read[1].image_id, 9u);
    EXPECT_EQ(read[1].position, Eigen::Vector3d(run, 9, 0.5));
    EXPECT_FALSE(read[1].is_geodetic);
    EXPECT_EQ(read[1].covariance->trace(), 6.0 * run);
    prior.gravity_in_cam.reset();
  }
}

TEST_F(PosePriorTableTest, ReadsTheTableOf310AndPassesOverWhatIsNone) {
  SqliteConnection database = Open();
  database.Execute(
      "CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, "
      "position BLOB, coordinate_system INTEGER NOT NULL);"
      "INSERT INTO pose_priors VALUES (4, NULL, 0);");
  const auto insert = [&](int id, const Eigen::Vector3d& position, int system) {
    SqliteStatement statement(&database,
                              "INSERT INTO pose_priors VALUES (?, ?, ?)");
    statement.BindInt(1, id);
    BindDoubles(&statement, 2, position.data(), 3);
    statement.BindInt(3, system);
    statement.Step();
  };
  insert(1, {48.0, 11.0, 500.0}, 0);
  insert(2, {kNan, kNan, kNan}, 0);
  insert(3, {1.0, 2.0, 3.0}, -1);
  const std::vector<HostPosition> positions = ReadHostPositions(&database);
  ASSERT_EQ(positions.size(), 1u);
  EXPECT_EQ(positions[0].image_id, 1u);
  EXPECT_TRUE(positions[0].is_geodetic);
  EXPECT_FALSE(positions[0].covariance.has_value());
}

TEST_F(PosePriorTableTest, ReadsWhatOlderVersionsTookFromExif) {
  SqliteConnection database = Open();
  EXPECT_TRUE(ReadHostPositions(&database).empty());
  database.Execute(
      "CREATE TABLE images (image_id INTEGER PRIMARY KEY, prior_tx REAL, "
      "prior_ty REAL, prior_tz REAL);"
      "INSERT INTO images VALUES (1, 48, 11, 500), (2, NULL, NULL, NULL);");
  const std::vector<HostPosition> positions = ReadHostPositions(&database);
  ASSERT_EQ(positions.size(), 1u);
  EXPECT_EQ(positions[0].position, Eigen::Vector3d(48.0, 11.0, 500.0));
  EXPECT_TRUE(positions[0].is_geodetic);
}

}  // namespace
}  // namespace adasfm
