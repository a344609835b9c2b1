// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/features.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

// The rows that COLMAP wrote are counted, not those that it should write.
TEST(Features, MissingRowsAreFound) {
  const TemporaryFolder folder;
  const std::string path = folder.File("database.db");
  SyntheticWorldOptions options;
  options.num_images = 12;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  ASSERT_TRUE(WriteSyntheticDatabase(world, path).ok());
  const auto execute = [&path](const std::string& sql) {
    SqliteConnection(path, SqliteConnection::Mode::kWrite).Execute(sql);
  };
  EXPECT_THAT(CheckFeatures(path).message(),
              HasSubstr("12 of 12 images are missing"));
  execute(
      "INSERT INTO descriptors SELECT image_id, 0, 128, x'' FROM keypoints");
  EXPECT_TRUE(CheckFeatures(path).ok());
  execute("DELETE FROM keypoints WHERE image_id = 5");
  EXPECT_THAT(CheckFeatures(path).message(),
              HasSubstr("1 of 12 images are missing (the first one is " +
                        world.images[4].name));

  std::vector<ImagePair> pairs;
  for (const SyntheticPair& pair : world.pairs) {
    pairs.emplace_back(pair.image_id1, pair.image_id2);
  }
  EXPECT_TRUE(CheckMatches(path, pairs).ok());
  execute(
      "DELETE FROM two_view_geometries WHERE pair_id = (SELECT MIN(pair_id) "
      "FROM two_view_geometries)");
  execute(
      "DELETE FROM matches WHERE pair_id = (SELECT MAX(pair_id) FROM matches)");
  EXPECT_THAT(CheckMatches(path, pairs).message(),
              HasSubstr("2 of " + std::to_string(pairs.size()) + " pairs"));
}

TEST(Features, CamerasAreSharedAsAsked) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.File("left"));
  std::filesystem::create_directories(folder.File("right"));
  const std::vector<std::string> names = {"left/1.png", "left/2.png",
                                          "right/1.png", "right/2.png"};
  for (const std::string& name : names) {
    cv::imwrite(folder.File(name), cv::Mat::zeros(30, 40, CV_8UC1));
  }
  for (const auto& [single_camera, num_cameras] :
       {std::pair(-1, 1), {0, 4}, {1, 1}, {2, 2}}) {
    FeatureOptions options;
    options.single_camera = single_camera;
    const std::string path = folder.File(std::to_string(single_camera) + ".db");
    const auto progress = [](const std::string&, double) {};
    // In two runs, as after an interruption.
    ASSERT_TRUE(RegisterImages(options, folder.Path(), {names[0], names[2]},
                               path, progress)
                    .ok());
    const StatusOr<ImageRegistration> images =
        RegisterImages(options, folder.Path(), names, path, progress);
    ASSERT_TRUE(images.ok()) << images.status().message();
    EXPECT_EQ(images->num_cameras, num_cameras) << single_camera;
  }
}

TEST(Features, CameraParamsMustBeUsable) {
  FeatureOptions options;
  options.camera_model = "PINHOLE";
  std::string error;
  for (const char* params : {"0,0,0,0", "nan,1,1,1", "100,-1,50,50"}) {
    options.camera_params = params;
    EXPECT_FALSE(options.IsValid(&error)) << params;
    EXPECT_THAT(error, HasSubstr("camera_params"));
  }
  options.camera_params = "100,100,50,50";
  EXPECT_TRUE(options.IsValid(&error)) << error;
}

TEST(Features, OptionsAreChecked) {
  std::string error;
  FeatureOptions options;
  EXPECT_TRUE(options.IsValid(&error)) << error;
  options.first_octave = 1;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_THAT(error, HasSubstr("first_octave"));
  options = FeatureOptions();
  options.matcher = "other";
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_THAT(error, HasSubstr("matcher"));
}

}  // namespace
}  // namespace adasfm
