// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/drives.h"

#include <gtest/gtest.h>

#include "colmap_ext/host/camera.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Images 1, 2 and, after a gap, 7, 8 are of camera 1; 3, 4 of camera 2, which a
// prior connects with image 5 of camera 3; 6 is of camera 4 without sensors; 9
// is of camera 5, of one rig with camera 2.
class DrivesTest : public testing::Test {
 protected:
  DrivesTest() {
    const std::map<image_t, camera_t> cameras = {
        {1, 1}, {2, 1}, {3, 2}, {4, 2}, {5, 3}, {6, 4}, {7, 1}, {8, 1}, {9, 5}};
    for (const auto& [image_id, camera_id] : cameras) {
      scene_.cameras[camera_id] = colmap::Camera();
      SceneImage& image = scene_.images[image_id];
      image.camera_id = camera_id;
      image.gravity_in_cam = Eigen::Vector3d::UnitY();
    }
    for (const auto& [first, last] : std::vector<std::pair<image_t, image_t>>{
             {3, 4}, {4, 5}, {1, 2}, {7, 8}}) {
      RelativePosePrior prior;
      prior.image_id1 = first;
      prior.image_id2 = last;
      scene_.priors.push_back(prior);
    }
    InertialMotion motion;
    motion.image_id1 = 7;
    motion.image_id2 = 8;
    motion.delta_velocity = Eigen::Vector3d::UnitY();
    scene_.inertial_motions.push_back(motion);
    scene_.rigs.cameras[2].rig_id = 1;
    scene_.rigs.cameras[5].rig_id = 1;
    NumberDrives(&scene_);
  }

  SceneData scene_;
};

TEST_F(DrivesTest, AreThoseOfOneMachine) {
  const std::vector<int> expected = {1, 1, 0, 0, 0, -1, 1, 1, 0};
  for (const auto& [image_id, image] : scene_.images) {
    EXPECT_EQ(image.drive, expected[image_id - 1]) << image_id;
  }
  EXPECT_EQ(scene_.priors[0].drive, 0);
  EXPECT_EQ(scene_.priors[1].drive, 0);
  EXPECT_EQ(scene_.priors[2].drive, 1);
  EXPECT_EQ(scene_.priors[3].drive, 1);
  EXPECT_EQ(scene_.inertial_motions[0].drive, 1);
}

TEST_F(DrivesTest, AreRotatedOneByOneAndBack) {
  const CameraImuCorrectionMap corrections = {
      {1, ExpSo3(Eigen::Vector3d(0.1, 0.0, 0.3))}};
  const Eigen::Vector3d turned = corrections.at(1) * Eigen::Vector3d::UnitY();
  RotateGravityAndMotions(corrections, &scene_);
  for (const auto& [image_id, image] : scene_.images) {
    EXPECT_EQ(*image.gravity_in_cam,
              image.drive == 1 ? turned : Eigen::Vector3d::UnitY());
  }
  EXPECT_LT((scene_.inertial_motions[0].delta_velocity - turned).norm(), 1e-12);
  RotateGravityAndMotions(Inverted(corrections), &scene_);
  EXPECT_LT(
      (*scene_.images.at(8).gravity_in_cam - Eigen::Vector3d::UnitY()).norm(),
      1e-12);
}

TEST_F(DrivesTest, CorrectionsByCameraAndBack) {
  const CameraImuCorrectionMap corrections = {
      {0, ExpSo3(Eigen::Vector3d(0.1, 0.0, 0.3))}};
  const auto by_camera = CorrectionsByCamera(scene_, corrections);
  EXPECT_EQ(by_camera.size(), 3);
  for (const camera_t camera_id : {2, 3, 5}) {
    EXPECT_EQ(by_camera.at(camera_id).coeffs(), corrections.at(0).coeffs());
  }
  const CameraImuCorrectionMap back = CorrectionsByDrive(scene_, by_camera);
  ASSERT_EQ(back.size(), 1);
  EXPECT_EQ(back.at(0).coeffs(), corrections.at(0).coeffs());
}

}  // namespace
}  // namespace adasfm
