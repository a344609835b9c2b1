// SPDX-License-Identifier: BSD-3-Clause
// One drive in the database of every COLMAP since 3.6.

#include <gtest/gtest.h>

#include <filesystem>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/reshape_database.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

// Every byte and type of the table of two-view geometries.
std::string DumpGeometries(const std::string& path) {
  SqliteConnection database(path, SqliteConnection::Mode::kRead);
  std::string columns;
  for (const std::string& column : database.Columns("two_view_geometries")) {
    columns += (columns.empty() ? "quote(" : ", quote(") + column + ")";
  }
  SqliteStatement statement(
      &database,
      "SELECT " + columns + " FROM two_view_geometries ORDER BY pair_id");
  const int num_columns = database.Columns("two_view_geometries").size();
  std::string text;
  while (statement.Step()) {
    for (int i = 0; i < num_columns; ++i) text += statement.Text(i) + "|";
    text += "\n";
  }
  return text;
}

class SchemasTest : public testing::Test {
 protected:
  SchemasTest() {
    SyntheticWorldOptions options;
    options.num_images = 24;
    options.num_keypoints_per_image = 150;
    const Status status = WriteSyntheticDatabase(BuildSyntheticWorld(options),
                                                 folder_.File("world.db"));
    EXPECT_TRUE(status.ok()) << status.message();
  }

  // The rows of a copy of the database after COLMAP 4.2 has opened it. With
  // `restore`, rows that adasfm_global had rewritten are restored afterwards.
  std::string DumpMigrated(const std::string& path, bool restore) {
    const std::string migrated = path + ".migrated";
    std::filesystem::copy_file(path, migrated);
    MigrateToColmap4(migrated);
    if (restore) {
      const StatusOr<RestoreSummary> restored =
          RestoreTwoViewGeometries(migrated);
      EXPECT_TRUE(restored.ok()) << restored.status().message();
      EXPECT_GT(restored->num_restored, 0);
      EXPECT_EQ(restored->num_outdated, 0);
    }
    const std::string dump = DumpGeometries(migrated);
    std::filesystem::remove(migrated);
    return dump;
  }

  // Makes the coarse model and the final model of the database in this form.
  void Reconstruct(const std::string& form, const std::string& output) {
    database_ = output + ".db";
    std::filesystem::copy_file(folder_.File("world.db"), database_);
    ReshapeDatabase(database_, form);
    original_ = DumpGeometries(database_);
    migrated_original_ = DumpMigrated(database_, /*restore=*/false);
    const auto coarse = EstimateCoarseModel(GlobalStageOptions(), database_,
                                            output + "/global");
    ASSERT_TRUE(coarse.ok()) << coarse.status().message();
    const auto mapped =
        MapParts(MapOptions(),
                 {database_, output + "/global/0", output + "/sparse"}, {});
    ASSERT_TRUE(mapped.ok()) << mapped.status().message();
  }

  TemporaryFolder folder_;
  std::string database_;
  std::string original_;
  std::string migrated_original_;
};

TEST_F(SchemasTest, AllFormsGiveTheSameModelsAndGetTheirOriginalsBack) {
  const std::string expected = folder_.File("expected");
  ASSERT_NO_FATAL_FAILURE(Reconstruct("3.8", expected));
  const StatusOr<colmap::Reconstruction> expected_model =
      ReadModel(expected + "/sparse/0");
  ASSERT_TRUE(expected_model.ok());
  const std::map<image_t, Rigid3d> expected_poses =
      CamsFromWorld(*expected_model);
  EXPECT_EQ(expected_poses.size(), 24);

  for (const std::string& form : DatabaseForms()) {
    SCOPED_TRACE("COLMAP " + form);
    const std::string output = folder_.File("form " + form);
    ASSERT_NO_FATAL_FAILURE(Reconstruct(form, output));
    for (const std::string file :
         {"cameras.bin", "images.bin", "points3D.bin"}) {
      EXPECT_EQ(ReadBytes(output + "/global/0/" + file),
                ReadBytes(expected + "/global/0/" + file))
          << file;
    }
    const StatusOr<colmap::Reconstruction> model =
        ReadModel(output + "/sparse/0");
    ASSERT_TRUE(model.ok());
    const std::map<image_t, Rigid3d> poses = CamsFromWorld(*model);
    ASSERT_EQ(poses.size(), expected_poses.size());
    for (const auto& [image_id, pose] : poses) {
      const Rigid3d& expected_pose = expected_poses.at(image_id);
      EXPECT_LT((pose.translation - expected_pose.translation).norm(), 1e-9);
      EXPECT_LT(pose.rotation.angularDistance(expected_pose.rotation), 1e-9);
    }
    for (const std::string file : {"rigs.bin", "frames.bin"}) {
      for (const std::string stage : {"global", "sparse"}) {
        EXPECT_EQ(std::filesystem::exists(output + "/" + stage + "/0/" + file),
                  form == "4.2, other frames");
      }
    }
    EXPECT_EQ(DumpMigrated(database_, /*restore=*/true), migrated_original_);
    const StatusOr<RestoreSummary> restored =
        RestoreTwoViewGeometries(database_);
    ASSERT_TRUE(restored.ok()) << restored.status().message();
    EXPECT_GT(restored->num_restored, 0);
    EXPECT_EQ(restored->num_outdated, 0);
    // A database of COLMAP 3.6 gets the columns that later versions add, empty.
    std::string now = DumpGeometries(database_);
    if (form == "3.6") {
      for (size_t at; (at = now.find("NULL|NULL|\n")) != std::string::npos;) {
        now.erase(at, 10);
      }
    }
    EXPECT_EQ(now, original_);
  }
}

}  // namespace
}  // namespace adasfm
