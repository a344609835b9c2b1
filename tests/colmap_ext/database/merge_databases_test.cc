// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/merge_databases.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/io/folder_lock.h"
#include "tests/testing/colmap_ext/file_size_limit.h"
#include "tests/testing/colmap_ext/reshape_database.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 12;

class MergeDatabasesTest : public testing::Test {
 protected:
  MergeDatabasesTest() {
    SyntheticWorldOptions options;
    options.num_images = kNumImages;
    options.num_keypoints_per_image = 40;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, whole_).ok());
  }

  // A copy of a database after some SQL.
  std::string Copy(const std::string& name, const std::string& sql,
                   const std::string& from = "") {
    const std::string path = folder_.File(name);
    std::filesystem::copy_file(
        from.empty() ? whole_ : from, path,
        std::filesystem::copy_options::overwrite_existing);
    SqliteConnection(path, SqliteConnection::Mode::kWrite).Execute(sql);
    return path;
  }

  // Two shards of features, and two of the matches of all images.
  std::vector<DatabaseToMerge> CutIntoShards(const std::string& from = "") {
    std::vector<DatabaseToMerge> shards;
    for (const std::string half : {"<=", ">"}) {
      const std::string is_other = "NOT (image_id " + half + " 6)";
      std::string frames;
      SqliteConnection database(from.empty() ? whole_ : from,
                                SqliteConnection::Mode::kRead);
      if (database.HasTable("frames")) {
        frames = "DELETE FROM frame_data WHERE NOT (data_id " + half +
                 " 6);"
                 "DELETE FROM frames WHERE frame_id NOT IN "
                 "(SELECT frame_id FROM frame_data);";
      }
      shards.push_back(
          {Copy("features" + std::to_string(shards.size()),
                frames +
                    "DELETE FROM matches;"
                    "DELETE FROM two_view_geometries;"
                    "DELETE FROM images WHERE " +
                    is_other + ";DELETE FROM keypoints WHERE " + is_other +
                    ";DELETE FROM descriptors WHERE " + is_other,
                from),
           ""});
    }
    for (const std::string parity : {"0", "1"}) {
      const std::string is_other = "pair_id % 2 != " + parity;
      shards.push_back(
          {Copy("matches" + parity,
                "DELETE FROM keypoints; DELETE FROM descriptors;"
                "DELETE FROM matches WHERE " +
                    is_other + ";DELETE FROM two_view_geometries WHERE " +
                    is_other,
                from),
           ""});
    }
    return shards;
  }

  // Every value of the tables, whose rows are put in order.
  static std::string Dump(const std::string& path,
                          const std::vector<std::string>& without = {}) {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    SqliteStatement tables(&database,
                           "SELECT name FROM sqlite_master WHERE type = "
                           "'table' AND name NOT LIKE 'sqlite_%' "
                           "ORDER BY name");
    std::string text;
    while (tables.Step()) {
      const std::string table = tables.Text(0);
      if (std::count(without.begin(), without.end(), table) > 0) continue;
      std::string columns;
      for (const std::string& column : database.Columns(table)) {
        columns +=
            (columns.empty() ? "quote(" : "||' '||quote(") + column + ")";
      }
      SqliteStatement rows(
          &database, "SELECT " + columns + " FROM " + table + " ORDER BY 1");
      while (rows.Step()) text += table + " " + rows.Text(0) + "\n";
    }
    return text;
  }

  void Merge(const std::vector<DatabaseToMerge>& inputs,
             const std::string& output) {
    const auto merged = MergeDatabases({}, inputs, output);
    ASSERT_TRUE(merged.ok()) << merged.status().message();
  }

  void ExpectError(const std::vector<DatabaseToMerge>& inputs,
                   const std::string& output, const std::string& message) {
    const bool existed = std::filesystem::exists(output);
    const std::string before = existed ? Dump(output) : "";
    const auto merged = MergeDatabases({}, inputs, output);
    ASSERT_FALSE(merged.ok());
    EXPECT_NE(merged.status().message().find(message), std::string::npos)
        << merged.status().message();
    EXPECT_EQ(std::filesystem::exists(output), existed);
    EXPECT_FALSE(std::filesystem::exists(output + ".part"));
    if (existed) {
      EXPECT_EQ(Dump(output), before);
    }
  }

  // Times and priors for all images.
  void WritePriors(const std::string& path) {
    PriorTables tables;
    for (const SyntheticImage& image : world_.images) {
      tables.image_times.push_back({image.image_id, image.timestamp_ns});
      tables.gravity.push_back({image.image_id, Eigen::Vector3d::UnitY()});
    }
    for (int i = 1; i < kNumImages; ++i) {
      RelativePosePrior prior;
      prior.image_id1 = world_.images[i - 1].image_id;
      prior.image_id2 = world_.images[i].image_id;
      prior.flags = kPriorRotation;
      prior.covariance.setIdentity();
      tables.priors.push_back(prior);
      InertialMotion motion;
      motion.image_id1 = prior.image_id1;
      motion.image_id2 = prior.image_id2;
      motion.dt_s = 0.1 * i;
      tables.inertial_motions.push_back(motion);
    }
    tables.wheel_scale = WheelScale{0.99, 0.002, 0.01};
    const Status status = WritePriorTables(path, tables);
    ASSERT_TRUE(status.ok()) << status.message();
  }

  TemporaryFolder folder_;
  const std::string whole_ = folder_.File("whole.db");
  SyntheticWorld world_;
};

TEST_F(MergeDatabasesTest, ShardsGiveTheWholeInAnyOrderAndEveryForm) {
  for (const std::string& form : DatabaseForms()) {
    SCOPED_TRACE("COLMAP " + form);
    const std::string whole = Copy("form.db", "");
    ReshapeDatabase(whole, form);
    std::vector<DatabaseToMerge> shards = CutIntoShards(whole);
    // Frames get new ids, to which nothing but frame_data refers.
    std::vector<std::string> without;
    if (form == "4.2, other frames") without = {"frames", "frame_data"};
    const std::string merged = folder_.File("merged " + form);
    ASSERT_NO_FATAL_FAILURE(Merge(shards, merged));
    EXPECT_EQ(Dump(merged, without), Dump(whole, without));
    const std::string reversed = folder_.File("reversed " + form);
    std::reverse(shards.begin(), shards.end());
    ASSERT_NO_FATAL_FAILURE(Merge(shards, reversed));
    EXPECT_EQ(Dump(reversed), Dump(merged));
  }
}

TEST_F(MergeDatabasesTest, FramesFollowTheirImages) {
  const std::string whole = Copy("form.db", "");
  ReshapeDatabase(whole, "4.2, other frames");
  const std::string merged = folder_.File("merged.db");
  ASSERT_NO_FATAL_FAILURE(Merge(CutIntoShards(whole), merged));
  SqliteConnection database(merged, SqliteConnection::Mode::kRead);
  SqliteStatement statement(
      &database,
      "SELECT COUNT(*), COUNT(DISTINCT f.frame_id) FROM images i "
      "JOIN frame_data d ON d.data_id = i.image_id "
      "JOIN frames f ON f.frame_id = d.frame_id "
      "JOIN rigs r ON r.rig_id = f.rig_id AND r.ref_sensor_id = i.camera_id");
  ASSERT_TRUE(statement.Step());
  EXPECT_EQ(statement.Int(0), kNumImages);
  EXPECT_EQ(statement.Int(1), kNumImages);
}

TEST_F(MergeDatabasesTest, TheSameAgainChangesNothing) {
  const std::vector<DatabaseToMerge> shards = CutIntoShards();
  const std::string output = folder_.File("merged.db");
  ASSERT_NO_FATAL_FAILURE(Merge({shards[1], shards[0]}, output));
  ASSERT_NO_FATAL_FAILURE(Merge({shards[3], shards[2]}, output));
  EXPECT_EQ(Dump(output), Dump(whole_));
  const auto again = MergeDatabases({}, shards, output);
  ASSERT_TRUE(again.ok()) << again.status().message();
  EXPECT_EQ(again->num_new_rows, 0);
  EXPECT_EQ(Dump(output), Dump(whole_));
}

TEST_F(MergeDatabasesTest, NewImagesDoNotMoveTheIdsThatAreThere) {
  const std::vector<DatabaseToMerge> shards = CutIntoShards();
  const std::string output = folder_.File("merged.db");
  // The later images are merged first, and keep the first ids.
  ASSERT_NO_FATAL_FAILURE(Merge({shards[1]}, output));
  const std::string before = Dump(output);
  ASSERT_NO_FATAL_FAILURE(Merge({shards[0]}, output));
  SqliteConnection database(output, SqliteConnection::Mode::kRead);
  const std::vector<DatabaseImage> images = ReadImages(&database);
  ASSERT_EQ(images.size(), kNumImages);
  EXPECT_EQ(images[0].name, world_.images[6].name);
  EXPECT_EQ(images[6].name, world_.images[0].name);
  // One camera took them all.
  EXPECT_EQ(ReadCameras(&database).size(), 1);
  // Matches are swapped where the order of a pair's images changes.
  ASSERT_NO_FATAL_FAILURE(Merge({shards[2], shards[3]}, output));
  SqliteConnection merged(output, SqliteConnection::Mode::kRead);
  SqliteConnection whole(whole_, SqliteConnection::Mode::kRead);
  const auto expected = ReadTwoViewGeometries(&whole, "two_view_geometries", 0);
  const auto actual = ReadTwoViewGeometries(&merged, "two_view_geometries", 0);
  ASSERT_EQ(actual.size(), expected.size());
  const auto new_id = [](image_t id) { return id > 6 ? id - 6 : id + 6; };
  int num_turned = 0;
  for (const DatabaseTwoViewGeometry& row : expected) {
    const image_t id1 = new_id(row.pair.image_id1);
    const image_t id2 = new_id(row.pair.image_id2);
    const auto match = std::find_if(
        actual.begin(), actual.end(),
        [&](const auto& other) { return other.pair == ImagePair(id1, id2); });
    ASSERT_NE(match, actual.end());
    const bool turned = id1 > id2;
    num_turned += turned;
    ASSERT_EQ(match->inlier_matches.size(), row.inlier_matches.size());
    for (size_t i = 0; i < row.inlier_matches.size(); ++i) {
      const FeatureMatch& a = row.inlier_matches[i];
      const FeatureMatch& b = match->inlier_matches[i];
      EXPECT_EQ(b.point2D_idx1, turned ? a.point2D_idx2 : a.point2D_idx1);
      EXPECT_EQ(b.point2D_idx2, turned ? a.point2D_idx1 : a.point2D_idx2);
    }
    ASSERT_TRUE(row.cam2_from_cam1.has_value());
    const Rigid3d pose =
        turned ? row.cam2_from_cam1->Inverse() : *row.cam2_from_cam1;
    EXPECT_LT((match->cam2_from_cam1->translation - pose.translation).norm(),
              1e-12);
    EXPECT_LT(match->cam2_from_cam1->rotation.angularDistance(pose.rotation),
              1e-7);
    const Eigen::Matrix3d essential =
        turned ? Eigen::Matrix3d(row.essential_matrix->transpose())
               : *row.essential_matrix;
    EXPECT_EQ(*match->essential_matrix, essential);
  }
  EXPECT_GT(num_turned, 3);
  EXPECT_LT(num_turned, static_cast<int>(expected.size()));
}

TEST_F(MergeDatabasesTest, SessionsAreKeptApartByTheirPrefixes) {
  ASSERT_NO_FATAL_FAILURE(WritePriors(whole_));
  const std::string output = folder_.File("sessions.db");
  ASSERT_NO_FATAL_FAILURE(
      Merge({{whole_, "tuesday/"}, {whole_, "monday/"}}, output));
  const StatusOr<LoadedPriorTables> one = ReadPriorTables(whole_);
  const StatusOr<LoadedPriorTables> both = ReadPriorTables(output);
  ASSERT_TRUE(one.ok() && both.ok()) << both.status().message();
  EXPECT_EQ(both->num_ignored_rows, 0);
  EXPECT_EQ(both->tables.priors.size(), 2 * one->tables.priors.size());
  EXPECT_EQ(both->tables.image_times.size(), 2 * kNumImages);
  EXPECT_EQ(both->tables.gravity.size(), 2 * kNumImages);
  SqliteConnection database(output, SqliteConnection::Mode::kRead);
  const std::vector<DatabaseImage> images = ReadImages(&database);
  ASSERT_EQ(images.size(), 2 * kNumImages);
  EXPECT_EQ(images.front().name, "monday/" + world_.images[0].name);
  EXPECT_EQ(images.back().name, "tuesday/" + world_.images.back().name);
  // Each has its own camera, though they are equal.
  EXPECT_EQ(images.front().camera_id, 1);
  EXPECT_EQ(images.back().camera_id, 2);
  // No prior and no pair joins the two.
  for (const RelativePosePrior& prior : both->tables.priors) {
    EXPECT_EQ(prior.image_id1 <= kNumImages, prior.image_id2 <= kNumImages);
  }
  // A wheel scale is valid for one session only.
  EXPECT_TRUE(one->tables.wheel_scale.has_value());
  EXPECT_FALSE(both->tables.wheel_scale.has_value());
  // Each session's ids follow the order of its images.
  const auto& motions = both->tables.inertial_motions;
  ASSERT_EQ(motions.size(), 2 * one->tables.inertial_motions.size());
  for (const InertialMotion& motion : motions) {
    EXPECT_EQ(motion.image_id2, motion.image_id1 + 1);
    EXPECT_EQ(motion.dt_s, 0.1 * ((motion.image_id1 - 1) % kNumImages + 1));
  }
  CountMatches(
      &database, "two_view_geometries", 0, [](const ImagePair& pair, int64_t) {
        EXPECT_EQ(pair.image_id1 <= kNumImages, pair.image_id2 <= kNumImages);
      });
}

TEST_F(MergeDatabasesTest, CamerasOfRigsGetTheirNewIds) {
  // A rig of the cameras 1 and 2; in the second session they have other ids.
  const std::string rig =
      "CREATE TABLE adasfm_rig_cameras (camera_id INTEGER PRIMARY KEY NOT "
      "NULL, reference_camera_id INTEGER NOT NULL);"
      "INSERT INTO adasfm_rig_cameras VALUES (1, 1), (2, 1);";
  const std::string second_camera =
      "INSERT INTO cameras SELECT 2, model, width + 1, height, params, "
      "prior_focal_length FROM cameras;"
      "UPDATE images SET camera_id = 2 WHERE image_id > 6;";
  const std::string first = Copy("first.db", second_camera + rig);
  const std::string other = Copy(
      "other.db", second_camera + rig + "UPDATE cameras SET width = width + 9");
  const std::string merged = folder_.File("merged.db");
  ASSERT_NO_FATAL_FAILURE(Merge({{first, "a/"}, {other, "b/"}}, merged));
  SqliteConnection database(merged, SqliteConnection::Mode::kRead);
  SqliteStatement rows(&database,
                       "SELECT camera_id, reference_camera_id FROM "
                       "adasfm_rig_cameras ORDER BY camera_id");
  std::vector<std::pair<int64_t, int64_t>> cameras;
  while (rows.Step()) cameras.emplace_back(rows.Int(0), rows.Int(1));
  ASSERT_EQ(cameras.size(), 4);
  EXPECT_EQ(cameras[0].second, cameras[0].first);
  EXPECT_EQ(cameras[1].second, cameras[0].first);
  EXPECT_EQ(cameras[2].second, cameras[2].first);
  EXPECT_EQ(cameras[3].second, cameras[2].first);
}

TEST_F(MergeDatabasesTest, CamerasAreSharedOrNot) {
  std::vector<DatabaseToMerge> shards = CutIntoShards();
  shards.resize(2);
  MergeDatabasesOptions options;
  options.share_cameras = false;
  const auto apart = MergeDatabases(options, shards, folder_.File("apart.db"));
  ASSERT_TRUE(apart.ok()) << apart.status().message();
  EXPECT_EQ(apart->num_cameras, 2);
  const auto shared = MergeDatabases({}, shards, folder_.File("shared.db"));
  ASSERT_TRUE(shared.ok()) << shared.status().message();
  EXPECT_EQ(shared->num_cameras, 1);
  // A camera of another size is another camera.
  SqliteConnection(shards[1].path, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE cameras SET width = width + 1");
  const auto differing =
      MergeDatabases({}, shards, folder_.File("differing.db"));
  ASSERT_TRUE(differing.ok()) << differing.status().message();
  EXPECT_EQ(differing->num_cameras, 2);
}

TEST_F(MergeDatabasesTest, ContradictionsAreErrorsAndChangeNothing) {
  const std::string name = world_.images[2].name;
  const std::string keypoints = Copy("keypoints.db",
                                     "UPDATE keypoints SET rows = 1, data = "
                                     "substr(data, 1, length(data) / rows) "
                                     "WHERE image_id = 3");
  ExpectError({{whole_, ""}, {keypoints, ""}}, folder_.File("new.db"),
              "table keypoints, image " + name);
  const std::string target = Copy("target.db", "");
  ExpectError({{keypoints, ""}}, target, "table keypoints, image " + name);
  const std::string camera =
      Copy("camera.db", "UPDATE cameras SET height = height + 1");
  ExpectError({{camera, ""}}, target, "has another camera in");
  const std::string unknown = Copy("unknown.db", "CREATE TABLE other (a)");
  ExpectError({{unknown, ""}}, target, "the table other");
  const std::string schema =
      Copy("schema.db", "UPDATE adasfm_meta SET value = '99'", [this]() {
        EXPECT_NO_FATAL_FAILURE(WritePriors(Copy("priors.db", "")));
        return folder_.File("priors.db");
      }());
  ExpectError({{schema, ""}}, target, "schema version 99");
  const std::string newer = Copy("newer.db", "");
  ReshapeDatabase(newer, "4.2");
  ExpectError({{newer, ""}}, target, "versions of COLMAP");
  ExpectError({{whole_, "a"},
               {Copy("b.db",
                     "UPDATE images SET name = "
                     "'a' || name"),
                ""}},
              folder_.File("new.db"), "both give the image name");
  const std::string dangling =
      Copy("dangling.db", "DELETE FROM images WHERE image_id = 2");
  ExpectError({{dangling, ""}}, folder_.File("new.db"), "which is missing");
  ExpectError({{target, ""}}, target, target);
  ExpectError({}, folder_.File("new.db"), "no databases");
}

TEST_F(MergeDatabasesTest, RewrittenDatabasesAreRefused) {
  const std::string rewritten = Copy("rewritten.db", "");
  const Status status = RewriteTwoViewGeometries(
      rewritten, {},
      {ImagePair(world_.images[0].image_id, world_.images[1].image_id)});
  ASSERT_TRUE(status.ok()) << status.message();
  ExpectError({{rewritten, ""}}, folder_.File("new.db"), "adasfm_restorer");
}

TEST_F(MergeDatabasesTest, ASecondRunIsRefused) {
  const auto lock = FolderLock::Acquire(
      folder_.Path(), FolderLock::Mode::kExclusive, kMergerLockName);
  ASSERT_TRUE(lock.ok()) << lock.status().message();
  ExpectError({{whole_, ""}}, folder_.File("new.db"), "in use by");
}

TEST_F(MergeDatabasesTest, AFullDiskLeavesTheOutputAsItWas) {
  const std::vector<DatabaseToMerge> shards = CutIntoShards();
  const std::string target = folder_.File("target.db");
  ASSERT_NO_FATAL_FAILURE(Merge({shards[0]}, target));
  const FileSizeLimit limit(std::filesystem::file_size(target) + 4096);
  ExpectError({shards.begin() + 1, shards.end()}, target, "cannot merge");
  ExpectError({{whole_, ""}}, folder_.File("new.db"), "cannot merge");
}

}  // namespace
}  // namespace adasfm
