// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/two_view_geometry_backup.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/reshape_database.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class TwoViewGeometryBackupTest : public testing::Test {
 protected:
  TwoViewGeometryBackupTest() {
    SyntheticWorldOptions options;
    options.num_images = 8;
    options.num_keypoints_per_image = 60;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, path_).ok());
    // Both kinds of "none" that COLMAP writes, which must come back as they
    // were.
    Execute(
        "UPDATE two_view_geometries SET H = NULL, F = X'' WHERE pair_id = "
        "(SELECT min(pair_id) FROM two_view_geometries);");
    for (const SyntheticPair& pair : world_.pairs) {
      const ImagePair ids(pair.image_id1, pair.image_id2);
      if (pair.inlier_matches.size() < 20) {
        removed_.push_back(ids);
      } else if (rows_.size() < 10) {
        NewTwoViewGeometry row{ids, pair.inlier_matches, pair.cam2_from_cam1};
        row.inlier_matches.resize(18);
        rows_.push_back(row);
      } else {
        removed_.push_back(ids);
      }
    }
  }

  void Execute(const std::string& sql) {
    SqliteConnection(path_, SqliteConnection::Mode::kWrite).Execute(sql);
  }

  // Every byte and type of a table, as text.
  std::string Dump(const std::string& table) {
    SqliteConnection database(path_, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database,
        "SELECT pair_id, rows, cols, quote(data), config, quote(F), quote(E), "
        "quote(H), quote(qvec), quote(tvec) FROM " +
            table + " ORDER BY pair_id");
    std::string text;
    while (statement.Step()) {
      for (int i = 0; i < 10; ++i) text += statement.Text(i) + "|";
      text += "\n";
    }
    return text;
  }

  void CopyTo(const std::string& name) {
    std::filesystem::copy_file(path_, folder_.File(name));
  }

  // Writes poses that mean "none" in COLMAP 3, and zero matrices, to pairs of
  // every kind.
  void WriteMissingPoses() {
    const std::string every =
        " WHERE pair_id IN (SELECT pair_id FROM "
        "(SELECT pair_id, row_number() OVER (ORDER BY pair_id) AS n FROM "
        "two_view_geometries) WHERE n % 4 = ";
    Execute(
        "UPDATE two_view_geometries SET E = zeroblob(72), H = zeroblob(72);"
        "UPDATE two_view_geometries SET tvec = zeroblob(24), qvec = X" +
        kNegativeZeroPose + every + "1);" +
        "UPDATE two_view_geometries SET tvec = zeroblob(24), qvec = X" +
        kIdentity + every + "2);" +
        "UPDATE two_view_geometries SET tvec = zeroblob(24), qvec = "
        "zeroblob(32)" +
        every + "3);");
  }

  // As hexadecimal text.
  const std::string kNegativeZeroPose = "'0000000000000000" +
                                        std::string("0000000000000080") +
                                        "00000000000000800000000000000080'";
  const std::string kIdentity =
      "'000000000000F03F" + std::string(48, '0') + "'";

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  SyntheticWorld world_;
  std::vector<NewTwoViewGeometry> rows_;
  std::vector<ImagePair> removed_;
};

TEST_F(TwoViewGeometryBackupTest, RestoresEveryByte) {
  const std::string original = Dump("two_view_geometries");
  const Status rewritten = RewriteTwoViewGeometries(path_, rows_, removed_);
  ASSERT_TRUE(rewritten.ok()) << rewritten.message();
  EXPECT_NE(Dump("two_view_geometries"), original);
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok()) << restored.status().message();
  EXPECT_EQ(restored->num_restored, rows_.size() + removed_.size());
  EXPECT_EQ(restored->num_outdated, 0);
  EXPECT_EQ(Dump("two_view_geometries"), original);
  // Nothing is left to restore.
  const std::string bytes = ReadBytes(path_);
  EXPECT_EQ(RestoreTwoViewGeometries(path_)->num_restored, 0);
  EXPECT_EQ(ReadBytes(path_), bytes);
}

TEST_F(TwoViewGeometryBackupTest, TwiceEqualsOnce) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  const std::string once = Dump("two_view_geometries");
  const std::string kept_once = Dump(kTwoViewGeometryBackupTable);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  EXPECT_EQ(Dump("two_view_geometries"), once);
  EXPECT_EQ(Dump(kTwoViewGeometryBackupTable), kept_once);
  // A rewrite with other rows starts from the originals too.
  const std::vector<NewTwoViewGeometry> fewer(rows_.begin(), rows_.begin() + 2);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, fewer, {}).ok());
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  EXPECT_EQ(Dump("two_view_geometries"), once);
}

TEST_F(TwoViewGeometryBackupTest, OriginalsCanBeRead) {
  SceneDataOptions options;
  options.min_num_matches = 0;
  const StatusOr<SceneData> before = ReadSceneData(path_, options);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  EXPECT_EQ(ReadSceneData(path_, options)->pairs.size(), rows_.size());
  options.use_original_two_view_geometries = true;
  const StatusOr<SceneData> after = ReadSceneData(path_, options);
  ASSERT_EQ(after->pairs.size(), before->pairs.size());
  for (size_t i = 0; i < after->pairs.size(); ++i) {
    EXPECT_EQ(after->pairs[i].inlier_matches, before->pairs[i].inlier_matches);
  }
}

TEST_F(TwoViewGeometryBackupTest, ColmapReadsTheNewRows) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  colmap::Database database(path_);
  EXPECT_EQ(database.NumVerifiedImagePairs(), rows_.size());
  for (const NewTwoViewGeometry& row : rows_) {
    const colmap::TwoViewGeometry read =
        database.ReadTwoViewGeometry(row.pair.image_id1, row.pair.image_id2);
    EXPECT_EQ(read.config, colmap::TwoViewGeometry::CALIBRATED);
    ASSERT_EQ(read.inlier_matches.size(), row.inlier_matches.size());
    EXPECT_EQ(read.inlier_matches[3].point2D_idx2,
              row.inlier_matches[3].point2D_idx2);
    const Eigen::Vector3d direction =
        row.cam2_from_cam1.translation.normalized();
    EXPECT_LT((read.tvec - direction).norm(), 1e-12);
    const Eigen::Matrix3d E =
        Hat(direction) * row.cam2_from_cam1.rotation.toRotationMatrix();
    EXPECT_LT((read.E - E).norm(), 1e-12);
    // F relates pixels as E relates rays.
    const Eigen::Matrix3d K = database.ReadCamera(1).CalibrationMatrix();
    EXPECT_LT((K.transpose() * read.F * K - E).norm(), 1e-9);
  }
}

TEST_F(TwoViewGeometryBackupTest, RowsThatColmapWroteSinceStay) {
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  // COLMAP verified one replaced and one removed pair anew.
  const std::string pair1 = std::to_string(PairIdFromImagePair(rows_[0].pair));
  const std::string pair2 = std::to_string(PairIdFromImagePair(removed_[0]));
  Execute("UPDATE two_view_geometries SET config = 3 WHERE pair_id = " + pair1 +
          "; INSERT INTO two_view_geometries VALUES (" + pair2 +
          ", 0, 2, X'', 1, X'', X'', X'', X'', X'');");
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok());
  EXPECT_EQ(restored->num_outdated, 2);
  EXPECT_EQ(restored->num_restored, rows_.size() + removed_.size() - 2);
  const std::string dump = Dump("two_view_geometries");
  EXPECT_NE(dump.find(pair2 + "|0|2|X''|1|"), std::string::npos);
  // Rows that were not restored stay in the backup.
  const std::string kept = Dump(kTwoViewGeometryBackupTable);
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 2);
  EXPECT_EQ(kept.find(pair1 + "|") == std::string::npos, false);
  // The rows that COLMAP verified anew are the originals of the next run.
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  EXPECT_EQ(RestoreTwoViewGeometries(path_)->num_outdated, 0);
  EXPECT_EQ(Dump("two_view_geometries"), dump);
}

TEST_F(TwoViewGeometryBackupTest, RestoresAfterColmap4OpenedTheFile) {
  WriteMissingPoses();
  CopyTo("migrated.db");
  const std::string written_by_us = path_;
  path_ = folder_.File("migrated.db");
  MigrateToColmap4(path_);
  const std::string expected = Dump("two_view_geometries");
  ASSERT_NE(expected.find("|NULL"), std::string::npos);

  path_ = written_by_us;
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  MigrateToColmap4(path_);
  const StatusOr<RestoreSummary> restored = RestoreTwoViewGeometries(path_);
  ASSERT_TRUE(restored.ok()) << restored.status().message();
  EXPECT_EQ(restored->num_restored, rows_.size() + removed_.size());
  EXPECT_EQ(restored->num_outdated, 0);
  EXPECT_EQ(Dump("two_view_geometries"), expected);
}

TEST_F(TwoViewGeometryBackupTest, RewritesAgainAfterColmap4OpenedTheFile) {
  WriteMissingPoses();
  const std::string expected_pairs = Dump("two_view_geometries");
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  const std::string once = Dump("two_view_geometries");
  MigrateToColmap4(path_);
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  EXPECT_EQ(Dump("two_view_geometries"), once);
  EXPECT_EQ(RestoreTwoViewGeometries(path_)->num_restored,
            rows_.size() + removed_.size());
  const std::string dump = Dump("two_view_geometries");
  EXPECT_EQ(std::count(dump.begin(), dump.end(), '\n'),
            std::count(expected_pairs.begin(), expected_pairs.end(), '\n'));
}

// Version 0.1.0 wrote H as zeros, and kept no more columns than COLMAP 3.8 has.
TEST_F(TwoViewGeometryBackupTest, RestoresWhatVersion010Wrote) {
  const std::string original = Dump("two_view_geometries");
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  Execute("UPDATE two_view_geometries SET H = zeroblob(72);");
  EXPECT_EQ(RestoreTwoViewGeometries(path_)->num_outdated, 0);
  EXPECT_EQ(Dump("two_view_geometries"), original);
}

TEST_F(TwoViewGeometryBackupTest, KeepsColumnsOfANewerColmap) {
  MigrateToColmap4(path_);
  Execute("UPDATE two_view_geometries SET camera1 = X'0102', camera2 = X'03';");
  ASSERT_TRUE(RewriteTwoViewGeometries(path_, rows_, removed_).ok());
  const auto count = [this](const std::string& where) {
    SqliteConnection database(path_, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database, "SELECT count(*) FROM two_view_geometries WHERE " + where);
    statement.Step();
    return statement.Int(0);
  };
  // Rewritten rows have no such cameras.
  EXPECT_EQ(count("camera1 IS NULL AND camera2 IS NULL"), rows_.size());
  ASSERT_TRUE(RestoreTwoViewGeometries(path_).ok());
  EXPECT_EQ(count("camera1 = X'0102' AND camera2 = X'03'"),
            rows_.size() + removed_.size());
}

TEST_F(TwoViewGeometryBackupTest, AddsThePosesThatColmap36LacksColumnsFor) {
  Execute(
      "ALTER TABLE two_view_geometries DROP COLUMN qvec;"
      "ALTER TABLE two_view_geometries DROP COLUMN tvec;");
  const Status rewritten = RewriteTwoViewGeometries(path_, rows_, removed_);
  ASSERT_TRUE(rewritten.ok()) << rewritten.message();
  SceneDataOptions options;
  options.min_num_matches = 0;
  const StatusOr<SceneData> written = ReadSceneData(path_, options);
  EXPECT_EQ(written->pairs.size(), rows_.size());
  for (const ScenePair& pair : written->pairs) {
    EXPECT_TRUE(pair.cam2_from_cam1.has_value());
  }
  EXPECT_EQ(RestoreTwoViewGeometries(path_)->num_restored,
            rows_.size() + removed_.size());
  const StatusOr<SceneData> restored = ReadSceneData(path_, options);
  EXPECT_EQ(restored->pairs.size(), world_.pairs.size());
  for (const ScenePair& pair : restored->pairs) {
    EXPECT_FALSE(pair.cam2_from_cam1.has_value());
  }
}

TEST_F(TwoViewGeometryBackupTest, ErrorLeavesTheDatabaseAsItWas) {
  const std::string before = ReadBytes(path_);
  std::vector<ImagePair> removed = removed_;
  removed.emplace_back(1, 99);
  EXPECT_FALSE(RewriteTwoViewGeometries(path_, rows_, removed).ok());
  EXPECT_EQ(ReadBytes(path_), before);
}

}  // namespace
}  // namespace adasfm
