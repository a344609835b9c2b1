// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/frames.h"

#include <gtest/gtest.h>

#include <cstring>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/color_points.h"
#include "colmap_ext/host/frame_files.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/reshape_database.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class FramesTest : public testing::Test {
 protected:
  FramesTest() {
    SyntheticWorldOptions options;
    options.num_images = 4;
    options.num_keypoints_per_image = 40;
    EXPECT_TRUE(
        WriteSyntheticDatabase(BuildSyntheticWorld(options), path_).ok());
  }

  void Execute(const std::string& sql) {
    SqliteConnection(path_, SqliteConnection::Mode::kWrite).Execute(sql);
  }

  DatabaseFrames ReadFrames() {
    SqliteConnection database(path_, SqliteConnection::Mode::kRead);
    return ReadDatabaseFrames(&database);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
};

TEST_F(FramesTest, AreNeededForOtherIdsOnly) {
  EXPECT_TRUE(ReadFrames().frames.empty());
  ReshapeDatabase(path_, "4.2");
  EXPECT_TRUE(ReadFrames().frames.empty());
  Execute("UPDATE rigs SET rig_id = 7; UPDATE frames SET rig_id = 7;");
  const DatabaseFrames frames = ReadFrames();
  EXPECT_TRUE(frames.has_tables);
  EXPECT_TRUE(frames.rigs.empty());
  ASSERT_EQ(frames.frames.size(), 4);
  EXPECT_EQ(frames.frames.at(3).frame_id, 3);
  EXPECT_EQ(frames.frames.at(3).rig_id, 7);
}

TEST_F(FramesTest, RigsOfSeveralCamerasAreFound) {
  ReshapeDatabase(path_, "4.2");
  // The pose of camera 2 is known, that of camera 3 is not.
  Execute(
      "INSERT INTO rig_sensors VALUES "
      "(1, 2, 0, X'000000000000F03F000000000000000000000000000000000000000000"
      "000000000000000000E0BF00000000000000000000000000000000'), "
      "(1, 3, 0, NULL);"
      "INSERT INTO cameras SELECT 2, model, width, height, params, "
      "prior_focal_length FROM cameras WHERE camera_id = 1;"
      "UPDATE images SET camera_id = 2 WHERE image_id = 2;"
      "UPDATE frame_data SET frame_id = 1, sensor_id = 2 WHERE data_id = 2;");
  const CameraRigs rigs = ReadFrames().rigs;
  ASSERT_EQ(rigs.cameras.size(), 3);
  EXPECT_TRUE(rigs.cameras.at(1).is_reference);
  EXPECT_FALSE(rigs.cameras.at(3).cam_from_rig.has_value());
  EXPECT_EQ(rigs.cameras.at(2).cam_from_rig->translation.x(), -0.5);
  EXPECT_EQ(rigs.images.at(1).frame_id, rigs.images.at(2).frame_id);
  EXPECT_NE(rigs.images.at(1).frame_id, rigs.images.at(3).frame_id);
  EXPECT_EQ(ReadFrames().frames.size(), 4);
}

template <typename T>
T Take(std::string* bytes) {
  T value{};
  EXPECT_GE(bytes->size(), sizeof(T));
  std::memcpy(&value, bytes->data(), std::min(sizeof(T), bytes->size()));
  bytes->erase(0, sizeof(T));
  return value;
}

TEST_F(FramesTest, FilesSayTheIdsAndPosesOfRegisteredImages) {
  colmap::Reconstruction model;
  colmap::Camera camera;
  camera.SetCameraId(2);
  camera.InitializeWithName("PINHOLE", 500.0, 640, 480);
  model.AddCamera(camera);
  const Rigid3d pose(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5),
                     Eigen::Vector3d(1.0, 2.0, 3.0));
  for (const image_t image_id : {5, 6, 4}) {
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetCameraId(2);
    image.SetName(std::to_string(image_id));
    SetCamFromWorld(pose, &image);
    model.AddImage(image);
    if (image_id != 6) model.RegisterImage(image_id);
  }
  ModelFrames frames;
  frames.frames = {{4, {14, 3}}, {5, {15, 3}}};
  ASSERT_TRUE(WriteModelFolder(folder_.Path(), {&model}, frames).ok());

  std::string rigs = ReadBytes(folder_.File("0/rigs.bin"));
  EXPECT_EQ(Take<uint64_t>(&rigs), 1);
  EXPECT_EQ(Take<uint32_t>(&rigs), 3);  // rig id
  EXPECT_EQ(Take<uint32_t>(&rigs), 1);  // number of cameras
  EXPECT_EQ(Take<int32_t>(&rigs), 0);   // camera, as type
  EXPECT_EQ(Take<uint32_t>(&rigs), 2);  // its camera id
  EXPECT_TRUE(rigs.empty());

  std::string file = ReadBytes(folder_.File("0/frames.bin"));
  EXPECT_EQ(Take<uint64_t>(&file), 2);
  for (const uint32_t image_id : {4, 5}) {
    EXPECT_EQ(Take<uint32_t>(&file), image_id + 10);
    EXPECT_EQ(Take<uint32_t>(&file), 3);
    for (const double value : {0.5, 0.5, -0.5, 0.5, 1.0, 2.0, 3.0}) {
      EXPECT_EQ(Take<double>(&file), value);
    }
    EXPECT_EQ(Take<uint32_t>(&file), 1);
    EXPECT_EQ(Take<int32_t>(&file), 0);
    EXPECT_EQ(Take<uint32_t>(&file), 2);
    EXPECT_EQ(Take<uint64_t>(&file), image_id);
  }
  EXPECT_TRUE(file.empty());
  // Models with the two files are read like other models.
  EXPECT_EQ(ReadModel(folder_.File("0"))->NumRegImages(), 2);
  // An image without a frame is an error.
  frames.frames.erase(5);
  EXPECT_FALSE(WriteModelFolder(folder_.Path(), {&model}, frames).ok());
}

// A model of the two cameras of a rig, with three images in two frames.
colmap::Reconstruction WriteRigModel(const std::string& folder) {
  const Rigid3d pose1(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5),
                      Eigen::Vector3d(1.0, 2.0, 3.0));
  const Rigid3d cam_from_rig(Eigen::Quaterniond::Identity(),
                             Eigen::Vector3d(-0.5, 0.0, 0.0));
  colmap::Reconstruction model;
  for (const camera_t camera_id : {1, 2}) {
    colmap::Camera camera;
    camera.SetCameraId(camera_id);
    camera.InitializeWithName("PINHOLE", 500.0, 640, 480);
    model.AddCamera(camera);
  }
  ModelFrames frames;
  frames.rigs.cameras[1] = {3, true, Rigid3d()};
  frames.rigs.cameras[2] = {3, false, Rigid3d()};  // Not what the model has.
  for (const image_t image_id : {1, 2, 4}) {       // 3 is not in the model.
    const camera_t camera_id = 2 - image_id % 2;
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetCameraId(camera_id);
    image.SetName(std::to_string(image_id));
    SetCamFromWorld(camera_id == 1 ? pose1 : cam_from_rig * pose1, &image);
    model.AddImage(image);
    model.RegisterImage(image_id);
    frames.rigs.images[image_id] = {camera_id, (image_id + 1) / 2};
    frames.frames[image_id] = {(image_id + 1) / 2, 3};
  }
  EXPECT_TRUE(WriteModelFolder(folder, {&model}, frames).ok());
  return model;
}

TEST_F(FramesTest, FilesSayTheRigOfTheModel) {
  WriteRigModel(folder_.Path());
  std::string rigs = ReadBytes(folder_.File("0/rigs.bin"));
  EXPECT_EQ(Take<uint64_t>(&rigs), 1);
  EXPECT_EQ(Take<uint32_t>(&rigs), 3);
  EXPECT_EQ(Take<uint32_t>(&rigs), 2);  // cameras
  EXPECT_EQ(Take<int32_t>(&rigs), 0);
  EXPECT_EQ(Take<uint32_t>(&rigs), 1);  // the reference
  EXPECT_EQ(Take<int32_t>(&rigs), 0);
  EXPECT_EQ(Take<uint32_t>(&rigs), 2);
  EXPECT_EQ(Take<uint8_t>(&rigs), 1);  // known
  for (const double value : {1.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0}) {
    EXPECT_NEAR(Take<double>(&rigs), value, 1e-12);
  }
  EXPECT_TRUE(rigs.empty());

  std::string file = ReadBytes(folder_.File("0/frames.bin"));
  EXPECT_EQ(Take<uint64_t>(&file), 2);
  for (const uint32_t frame_id : {1, 2}) {
    EXPECT_EQ(Take<uint32_t>(&file), frame_id);
    EXPECT_EQ(Take<uint32_t>(&file), 3);
    // Both frames have the pose of the reference camera, with or without its
    // image.
    for (const double value : {0.5, 0.5, -0.5, 0.5, 1.0, 2.0, 3.0}) {
      EXPECT_NEAR(Take<double>(&file), value, 1e-12);
    }
    const uint32_t num_images = Take<uint32_t>(&file);
    ASSERT_EQ(num_images, frame_id == 1 ? 2 : 1);
    for (uint32_t k = 0; k < num_images; ++k) {
      Take<int32_t>(&file);
      const uint32_t camera_id = Take<uint32_t>(&file);
      EXPECT_EQ(Take<uint64_t>(&file), 2 * (frame_id - 1) + camera_id);
    }
  }
  EXPECT_TRUE(file.empty());
}

TEST_F(FramesTest, FilesAreReadAsWritten) {
  EXPECT_TRUE(ReadFrameFiles(folder_.Path())->frames.empty());
  const colmap::Reconstruction model = WriteRigModel(folder_.Path());
  const std::string rigs = ReadBytes(folder_.File("0/rigs.bin"));
  const std::string file = ReadBytes(folder_.File("0/frames.bin"));
  const StatusOr<ModelFrames> frames = ReadFrameFiles(folder_.File("0"));
  ASSERT_TRUE(frames.ok()) << frames.status().message();
  ASSERT_TRUE(WriteModelFolder(folder_.File("again"), {&model}, *frames).ok());
  EXPECT_EQ(ReadBytes(folder_.File("again/0/rigs.bin")), rigs);
  EXPECT_EQ(ReadBytes(folder_.File("again/0/frames.bin")), file);
  for (size_t size = 0; size < file.size(); size += 7) {
    folder_.Write("0/frames.bin", file.substr(0, size));
    EXPECT_FALSE(ReadFrameFiles(folder_.File("0")).ok()) << size;
  }
  // Sensors other than cameras are ignored.
  std::string imu = file;
  imu[8 + 2 * 4 + 7 * 8 + 4] = 1;
  folder_.Write("0/frames.bin", imu);
  EXPECT_TRUE(ReadFrameFiles(folder_.File("0"))->frames.empty());
}

TEST_F(FramesTest, FilesStayWhenPointsAreColoured) {
  WriteRigModel(folder_.Path());
  const std::string rigs = ReadBytes(folder_.File("0/rigs.bin"));
  const std::string file = ReadBytes(folder_.File("0/frames.bin"));
  ASSERT_TRUE(ColorPoints(folder_.File("photos"), folder_.Path(),
                          folder_.File("colors.log"))
                  .ok());
  EXPECT_EQ(ReadBytes(folder_.File("0/rigs.bin")), rigs);
  EXPECT_EQ(ReadBytes(folder_.File("0/frames.bin")), file);
}

TEST_F(FramesTest, FilesOfAnotherModelGo) {
  const colmap::Reconstruction model = WriteRigModel(folder_.Path());
  ASSERT_TRUE(WriteBinaryModel(model, folder_.File("0")).ok());
  EXPECT_FALSE(std::filesystem::exists(folder_.File("0/rigs.bin")));
  EXPECT_FALSE(std::filesystem::exists(folder_.File("0/frames.bin")));
}

TEST_F(FramesTest, ModelsWithUnknownCamerasAreNamed) {
  std::string bytes(8 + 4, '\0');
  bytes[0] = 1;
  bytes[8] = 1;
  bytes += std::string("\x10\0\0\0", 4) + std::string(16 + 6 * 8, '\0');
  std::filesystem::create_directory(folder_.File("model"));
  folder_.Write("model/cameras.bin", bytes);
  folder_.Write("model/images.bin", std::string(8, '\0'));
  folder_.Write("model/points3D.bin", std::string(8, '\0'));
  const auto model = ReadModel(folder_.File("model"));
  ASSERT_FALSE(model.ok());
  EXPECT_NE(model.status().message().find("EUCM"), std::string::npos)
      << model.status().message();
}

}  // namespace
}  // namespace adasfm
