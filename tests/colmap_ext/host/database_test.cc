// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <sstream>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

SyntheticWorld BuildSmallWorld() {
  SyntheticWorldOptions options;
  options.num_images = 12;
  options.num_keypoints_per_image = 80;
  return BuildSyntheticWorld(options);
}

class DatabaseTest : public testing::Test {
 protected:
  DatabaseTest() {
    const Status status = WriteSyntheticDatabase(world_, path_);
    EXPECT_TRUE(status.ok()) << status.message();
  }

  void Execute(const std::string& sql) {
    SqliteConnection(path_, SqliteConnection::Mode::kWrite).Execute(sql);
  }

  // Expects that the file is rejected with this message and stays as it is.
  void ExpectRefused(const std::string& path, const std::string& message) {
    const std::string before = ReadBytes(path);
    const Status status = CheckDatabase(path);
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.message().find(message), std::string::npos)
        << status.message();
    EXPECT_NE(status.message().find(path), std::string::npos);
    EXPECT_EQ(status.message().find('\n'), std::string::npos);
    EXPECT_FALSE(ReadSceneData(path, SceneDataOptions()).ok());
    EXPECT_EQ(ReadBytes(path), before);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  SyntheticWorld world_ = BuildSmallWorld();
};

TEST_F(DatabaseTest, RefusesWhatIsNotADatabase) {
  ExpectRefused(folder_.File("missing.db"), "does not exist");
  EXPECT_FALSE(std::filesystem::exists(folder_.File("missing.db")));
  EXPECT_FALSE(CheckDatabase(folder_.Path()).ok());
  ExpectRefused(folder_.Write("empty.db", ""), "is empty");
  ExpectRefused(folder_.Write("text.db", "This is a text, not a database."),
                "not a database");
  ExpectRefused(folder_.Write("cut.db", ReadBytes(path_).substr(0, 5000)),
                "not a database of COLMAP");
}

TEST_F(DatabaseTest, RefusesOtherSqliteFiles) {
  Execute("ALTER TABLE matches RENAME TO other;");
  ExpectRefused(path_, "table matches is missing");
}

TEST_F(DatabaseTest, ReadsWhatANewerColmapWroteButNotThroughTheLibrary) {
  EXPECT_TRUE(CheckLibraryOpens(path_).ok());
  EXPECT_TRUE(CheckLibraryOpens(folder_.File("missing.db")).ok());
  const StatusOr<SceneData> before = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(before.ok());
  Execute(
      "CREATE TABLE pose_priors (pose_prior_id INTEGER);"
      "CREATE TABLE frames (frame_id INTEGER);"
      "ALTER TABLE images DROP COLUMN prior_qw;");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->pairs.size(), before->pairs.size());

  // No command changes the file, not even its version.
  const std::string bytes = ReadBytes(path_);
  const ProgressCallback progress = [](const std::string&, double) {};
  const FeatureOptions options;
  for (const Status& status :
       {CheckLibraryOpens(path_),
        RegisterImages(options, folder_.Path(), {"a.png"}, path_, progress)
            .status(),
        ExtractFeatures(options, folder_.Path(), path_, folder_.File("log"),
                        progress),
        MatchPairs(options, {ImagePair(1, 2)}, path_, folder_.File("log"),
                   progress)}) {
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.message().find("newer COLMAP"), std::string::npos)
        << status.message();
  }
  EXPECT_EQ(ReadBytes(path_), bytes);
}

TEST_F(DatabaseTest, ReadsTheDatabaseOfColmap36) {
  Execute(
      "ALTER TABLE two_view_geometries DROP COLUMN qvec;"
      "ALTER TABLE two_view_geometries DROP COLUMN tvec;");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->pairs.size(), world_.pairs.size());
  for (const ScenePair& pair : scene->pairs) {
    EXPECT_FALSE(pair.cam2_from_cam1.has_value());
  }
}

// Doubles as a literal of SQL.
std::string ParamsBlob(const std::vector<double>& params) {
  std::ostringstream hex;
  for (const double value : params) {
    unsigned char bytes[sizeof(double)];
    std::memcpy(bytes, &value, sizeof(double));
    for (const unsigned char byte : bytes) {
      char text[3];
      std::snprintf(text, sizeof(text), "%02X", byte);
      hex << text;
    }
  }
  return "X'" + hex.str() + "'";
}

// A ray at the angle theta from the axis is at the distance f * theta from the
// principal point.
TEST_F(DatabaseTest, ConvertsEquidistantCameras) {
  const std::pair<int, std::vector<double>> cameras[] = {
      {14, {300.0, 320.0, 240.0}}, {15, {300.0, 280.0, 320.0, 240.0}}};
  for (const auto& [model_id, params] : cameras) {
    Execute("UPDATE cameras SET model = " + std::to_string(model_id) +
            ", params = " + ParamsBlob(params) + ";");
    const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    const colmap::Camera& camera = scene->cameras.begin()->second;
    EXPECT_EQ(camera.ModelName(), "OPENCV_FISHEYE");
    const double theta = 0.9, phi = 0.4;
    const Eigen::Vector3d ray(std::sin(theta) * std::cos(phi),
                              std::sin(theta) * std::sin(phi), std::cos(theta));
    const Eigen::Vector2d expected(
        320.0 + params[0] * theta * std::cos(phi),
        240.0 + params[params.size() - 3] * theta * std::sin(phi));
    EXPECT_LT((ProjectPoint(camera, ray).value() - expected).norm(), 1e-9);
  }
}

TEST_F(DatabaseTest, NamesCameraModelsThatCannotBeConverted) {
  Execute("UPDATE cameras SET model = 16, params = zeroblob(48);");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.status().message().find("EUCM"), std::string::npos);
  EXPECT_EQ(scene.status().message().find("damaged"), std::string::npos);
}

TEST_F(DatabaseTest, ReadsTheSceneAndChangesNothing) {
  const std::string before = ReadBytes(path_);
  SceneDataOptions options;
  options.read_raw_matches = true;
  options.min_num_matches = 0;
  const StatusOr<SceneData> scene = ReadSceneData(path_, options);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(ReadBytes(path_), before);
  EXPECT_FALSE(std::filesystem::exists(path_ + "-wal"));
  EXPECT_FALSE(std::filesystem::exists(path_ + "-shm"));

  ASSERT_EQ(scene->images.size(), world_.images.size());
  for (const SyntheticImage& image : world_.images) {
    const SceneImage& read = scene->images.at(image.image_id);
    EXPECT_EQ(read.name, image.name);
    ASSERT_EQ(read.keypoints.size(), image.keypoints.size());
    for (size_t i = 0; i < read.keypoints.size(); ++i) {
      // The table stores floats.
      EXPECT_LT((read.keypoints[i] - image.keypoints[i]).norm(), 1e-3);
    }
    EXPECT_FALSE(read.timestamp_ns.has_value());
  }
  ASSERT_EQ(scene->pairs.size(), world_.pairs.size());
  for (size_t i = 0; i < world_.pairs.size(); ++i) {
    EXPECT_EQ(scene->pairs[i].image_id1, world_.pairs[i].image_id1);
    EXPECT_EQ(scene->pairs[i].image_id2, world_.pairs[i].image_id2);
    EXPECT_EQ(scene->pairs[i].inlier_matches, world_.pairs[i].inlier_matches);
    EXPECT_EQ(scene->pairs[i].raw_matches, world_.pairs[i].raw_matches);
  }
  EXPECT_TRUE(scene->priors.empty());
}

TEST_F(DatabaseTest, LeavesOutPairsWithFewMatches) {
  SceneDataOptions options;
  options.min_num_matches = 30;
  const StatusOr<SceneData> scene = ReadSceneData(path_, options);
  ASSERT_TRUE(scene.ok());
  size_t num_expected = 0;
  for (const SyntheticPair& pair : world_.pairs) {
    num_expected += pair.inlier_matches.size() >= 30;
  }
  EXPECT_EQ(scene->pairs.size(), num_expected);
  for (const ScenePair& pair : scene->pairs) {
    EXPECT_GE(pair.inlier_matches.size(), 30);
    EXPECT_TRUE(pair.raw_matches.empty());
  }
}

TEST_F(DatabaseTest, ZeroPoseMeansNoPose) {
  Execute(
      "UPDATE two_view_geometries SET tvec = zeroblob(24), E = zeroblob(72);");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok());
  ASSERT_FALSE(scene->pairs.empty());
  for (const ScenePair& pair : scene->pairs) {
    EXPECT_FALSE(pair.cam2_from_cam1.has_value());
    EXPECT_FALSE(pair.essential_matrix.has_value());
  }
}

TEST_F(DatabaseTest, RefusesRowsThatContradictEachOther) {
  const char* statements[] = {
      "UPDATE keypoints SET rows = rows + 1 WHERE image_id = 3;",
      "UPDATE two_view_geometries SET data = zeroblob(9);",
      "UPDATE two_view_geometries SET E = zeroblob(8);",
      "UPDATE cameras SET model = 99;",
      "UPDATE cameras SET params = zeroblob(8);",
      "UPDATE images SET camera_id = 7 WHERE image_id = 2;",
      "DELETE FROM keypoints WHERE image_id = 2;",
  };
  const std::string original = ReadBytes(path_);
  for (const char* statement : statements) {
    folder_.Write("database.db", original);
    Execute(std::string("PRAGMA foreign_keys = OFF;") + statement);
    const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
    EXPECT_FALSE(scene.ok()) << statement;
    EXPECT_EQ(scene.status().message().find('\n'), std::string::npos);
  }
}

// Counts whose product with a row's size is that of an empty blob.
TEST_F(DatabaseTest, RefusesCountsThatOverflow) {
  const std::string original = ReadBytes(path_);
  for (const char* sql :
       {"UPDATE two_view_geometries SET rows = 1 << 61, data = x''",
        "UPDATE keypoints SET rows = 1 << 62, cols = 4, data = x''",
        "UPDATE keypoints SET rows = 1 << 40, cols = 1 << 40, data = x''"}) {
    Execute(sql);
    const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
    ASSERT_FALSE(scene.ok()) << sql;
    EXPECT_NE(scene.status().message().find("malformed"), std::string::npos)
        << scene.status().message();
    folder_.Write("database.db", original);
  }
}

TEST_F(DatabaseTest, RefusesAnImagePairedWithItself) {
  Execute("UPDATE two_view_geometries SET pair_id = " +
          std::to_string(PairIdFromImagePair(ImagePair(5, 5))) +
          " WHERE pair_id = (SELECT MIN(pair_id) FROM two_view_geometries)");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.status().message().find("paired with itself"),
            std::string::npos);
}

TEST_F(DatabaseTest, IgnoresPairsOfDeletedImages) {
  Execute(
      "DELETE FROM keypoints WHERE image_id = 4;"
      "DELETE FROM images WHERE image_id = 4;");
  const StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  for (const ScenePair& pair : scene->pairs) {
    EXPECT_NE(pair.image_id1, 4);
    EXPECT_NE(pair.image_id2, 4);
  }
}

TEST_F(DatabaseTest, ReadsSinglePairsAndImagesAsAll) {
  SqliteConnection database(path_, SqliteConnection::Mode::kRead);
  std::map<ImagePair, int64_t> counts;
  CountMatches(&database, "matches", 1,
               [&counts](const ImagePair& pair, int64_t count) {
                 counts[pair] = count;
               });
  int num_pairs = 0;
  ReadMatches(
      &database, [&](const ImagePair& pair, std::vector<FeatureMatch> matches) {
        ++num_pairs;
        EXPECT_EQ(counts[pair], matches.size());
        EXPECT_EQ(ReadMatchesOfPair(&database, "matches", pair), matches);
      });
  EXPECT_GT(num_pairs, 0);
  EXPECT_EQ(counts.size(), num_pairs);
  for (const auto& [image_id, points] : ReadKeypoints(&database)) {
    EXPECT_EQ(ReadKeypointsOfImage(&database, image_id), points);
  }
  EXPECT_TRUE(ReadKeypointsOfImage(&database, 999).empty());
  EXPECT_TRUE(
      ReadMatchesOfPair(&database, "matches", ImagePair(1, 999)).empty());
}

}  // namespace
}  // namespace adasfm
