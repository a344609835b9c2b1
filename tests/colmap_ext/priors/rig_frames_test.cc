// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/rig_frames.h"

#include <gtest/gtest.h>

#include "core/so3.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

// Images 1, 2, ... with these names and cameras.
SceneData MakeScene(const std::vector<std::pair<std::string, camera_t>>& rows) {
  SceneData scene;
  for (const auto& [name, camera_id] : rows) {
    const image_t image_id = scene.images.size() + 1;
    scene.images[image_id].image_id = image_id;
    scene.images[image_id].name = name;
    scene.images[image_id].camera_id = camera_id;
  }
  return scene;
}

SensorCalibration MakeCalibration() {
  SensorCalibration calibration;
  calibration.cam_from_imu = Rigid3d(ExpSo3(Eigen::Vector3d(0.1, 0.2, 0.3)),
                                     Eigen::Vector3d(1.0, 2.0, 3.0));
  calibration.other_cams_from_imu = {
      Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.5, 0.0, 0.0)) *
      calibration.cam_from_imu};
  return calibration;
}

std::vector<std::string> warnings;

TEST(FindRigCameras, TakesFoldersElseTheOrderOfIds) {
  SensorCalibration calibration = MakeCalibration();
  const auto by_folder = FindRigCameras(
      RigOptions(), MakeScene({{"a/cam1/data/1.png", 3}, {"a/cam0/1.png", 8}}),
      &calibration, &warnings);
  ASSERT_TRUE(by_folder.ok()) << by_folder.status().message();
  EXPECT_TRUE(by_folder->at(8).is_reference);
  EXPECT_EQ(by_folder->at(3).rig_id, 8u);
  // The sigmas are those of a rig from the host's tables.
  EXPECT_EQ(by_folder->at(3).rotation_sigma_rad,
            RigCamera().rotation_sigma_rad);
  EXPECT_EQ(by_folder->at(3).translation_sigma_m,
            RigCamera().translation_sigma_m);
  EXPECT_TRUE(PosesNear(
      *by_folder->at(3).cam_from_rig,
      Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.5, 0.0, 0.0)),
      1e-12, 1e-12));
  const auto by_id =
      FindRigCameras(RigOptions(), MakeScene({{"l.png", 3}, {"r.png", 8}}),
                     &calibration, &warnings);
  EXPECT_TRUE(by_id->at(3).is_reference);
  EXPECT_TRUE(warnings.empty());
}

TEST(FindRigCameras, OneCameraIsNoRig) {
  SensorCalibration calibration = MakeCalibration();
  // EuRoC's calibration, and the images of its first camera only.
  EXPECT_TRUE(FindRigCameras(RigOptions(), MakeScene({{"cam0/1.png", 1}}),
                             &calibration, &warnings)
                  ->empty());
  EXPECT_TRUE(FindRigCameras(RigOptions(), MakeScene({{"1.png", 1}}),
                             &calibration, &warnings)
                  ->empty());
  EXPECT_TRUE(warnings.empty());
  // A camera for each photo.
  EXPECT_TRUE(
      FindRigCameras(RigOptions(),
                     MakeScene({{"1.png", 1}, {"2.png", 2}, {"3.png", 3}}),
                     &calibration, &warnings)
          ->empty());
  EXPECT_EQ(warnings.size(), 1u);
  warnings.clear();
}

TEST(FindRigCameras, SharedCamerasAreAnError) {
  SensorCalibration calibration = MakeCalibration();
  const auto shared = FindRigCameras(
      RigOptions(), MakeScene({{"cam0/1.png", 1}, {"cam1/1.png", 1}}),
      &calibration, &warnings);
  ASSERT_FALSE(shared.ok());
  EXPECT_NE(shared.status().message().find("single_camera_per_folder"),
            std::string::npos);
}

TEST(FindRigCameras, TheHostsReferenceCameraStaysReference) {
  SensorCalibration calibration = MakeCalibration();
  const Rigid3d cam1_from_imu = calibration.other_cams_from_imu.front();
  SceneData scene = MakeScene({{"cam0/1.png", 1}, {"cam1/1.png", 2}});
  scene.rigs.cameras[2].is_reference = true;
  const auto cameras =
      FindRigCameras(RigOptions(), scene, &calibration, &warnings);
  EXPECT_TRUE(cameras->at(2).is_reference);
  EXPECT_NEAR(cameras->at(1).cam_from_rig->translation.x(), 0.5, 1e-12);
  EXPECT_TRUE(PosesNear(calibration.cam_from_imu, cam1_from_imu, 1e-12, 1e-12));
}

TEST(GroupFrames, ImagesOfOneTimeAreOneFrame) {
  const SceneData scene = MakeScene({{"cam0/1", 1},
                                     {"cam1/1", 2},
                                     {"cam1/2", 2},
                                     {"cam0/2", 1},
                                     {"cam1/3", 2},
                                     {"cam0/4", 1},
                                     {"other", 9}});
  std::map<camera_t, RigCamera> cameras;
  cameras[1].is_reference = true;
  cameras[2].cam_from_rig = Rigid3d();
  std::vector<ImageStamp> stamps = {
      {1, "", 1'000'000'000}, {7, "", 1'000'000'100}, {2, "", 1'000'900'000},
      {3, "", 2'000'000'000}, {4, "", 2'000'300'000}, {5, "", 3'000'000'000},
      {6, "", 3'001'100'000}};
  const std::vector<ImageStamp> frames = GroupFrames(scene, cameras, &stamps);
  std::map<image_t, timestamp_t> times;
  for (const ImageStamp& stamp : stamps) {
    times[stamp.image_id] = stamp.timestamp_ns;
  }
  EXPECT_EQ(times[2], 1'000'000'000);
  EXPECT_EQ(times[7], 1'000'000'100);
  EXPECT_EQ(times[3], 2'000'300'000);  // The reference camera's.
  EXPECT_EQ(times[5], 3'000'000'000);
  EXPECT_EQ(times[6], 3'001'100'000);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[1].image_id, 4u);
  // Without a rig each time stamp is a frame.
  EXPECT_EQ(GroupFrames(scene, {}, &stamps).size(), stamps.size());
}

}  // namespace
}  // namespace adasfm
