// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/model_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "colmap_ext/host/model.h"
#include "tests/testing/colmap_ext/file_size_limit.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A model with num_images images of one camera.
colmap::Reconstruction MakeModel(int num_images) {
  colmap::Reconstruction model;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.InitializeWithName("PINHOLE", 100.0, 200, 100);
  model.AddCamera(camera);
  for (int i = 1; i <= num_images; ++i) {
    colmap::Image image;
    image.SetImageId(i);
    image.SetCameraId(1);
    image.SetName("image" + std::to_string(i));
    image.SetPoints2D(std::vector<Eigen::Vector2d>(20, {1.0, 2.0}));
    model.AddImage(image);
    model.RegisterImage(i);
  }
  return model;
}

class ModelFolderTest : public testing::Test {
 protected:
  Status Write(int num_models, int num_images = 2) {
    const colmap::Reconstruction model = MakeModel(num_images);
    return WriteModelFolder(
        folder_.Path(),
        std::vector<const colmap::Reconstruction*>(num_models, &model));
  }

  TemporaryFolder folder_;
};

TEST_F(ModelFolderTest, ReplacesItsOwnModels) {
  ASSERT_TRUE(Write(3).ok());
  ASSERT_TRUE(Write(1, 5).ok());
  EXPECT_EQ(ReadModel(folder_.File("0"))->NumRegImages(), 5);
  EXPECT_FALSE(fs::exists(folder_.File("1")));
  EXPECT_FALSE(fs::exists(folder_.File("2")));
}

TEST_F(ModelFolderTest, ForeignFilesStay) {
  ASSERT_TRUE(Write(3).ok());
  // In the folder of a model, of one that would be removed, and of neither.
  for (const char* name : {"0", "2", "17"}) {
    fs::create_directories(folder_.File(name));
    const std::string photo =
        folder_.Write(std::string(name) + "/photo.jpg", "x");
    const Status status = Write(1);
    ASSERT_FALSE(status.ok()) << name;
    EXPECT_THAT(status.message(), HasSubstr(photo));
    EXPECT_EQ(ReadBytes(photo), "x");
    EXPECT_TRUE(fs::exists(folder_.File("1/images.bin")));
    fs::remove(photo);
  }
  EXPECT_TRUE(Write(1).ok());
}

TEST_F(ModelFolderTest, LinksAndFilesAreNotFollowed) {
  const TemporaryFolder other;
  other.Write("cameras.bin", "x");
  fs::create_directory_symlink(other.Path(), folder_.File("0"));
  EXPECT_THAT(Write(1).message(), HasSubstr("which is not a folder"));
  EXPECT_TRUE(fs::exists(other.File("cameras.bin")));
  fs::remove(folder_.File("0"));
  folder_.Write("0", "notes");
  EXPECT_FALSE(Write(1).ok());
  EXPECT_EQ(ReadBytes(folder_.File("0")), "notes");
}

TEST_F(ModelFolderTest, FailedWriteNamesTheCauseAndKeepsTheOldModel) {
  ASSERT_TRUE(Write(1, 2).ok());
  {
    const FileSizeLimit limit(10000);
    const Status status = Write(1, 200);
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.message(), HasSubstr("images.bin: File too large"));
  }
  EXPECT_EQ(ReadModel(folder_.File("0"))->NumRegImages(), 2);
  EXPECT_FALSE(fs::exists(folder_.File(".models.tmp")));
}

}  // namespace
}  // namespace adasfm
