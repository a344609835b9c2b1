// SPDX-License-Identifier: BSD-3-Clause
#include "core/camera_rig.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

const Rigid3d kCam2FromCam1(ExpSo3(Eigen::Vector3d(0.02, -0.4, 0.01)),
                            Eigen::Vector3d(-0.5, 0.02, 0.1));

// Frames 1, 2, ... with the images k of camera 1, the reference, and 100 + k of
// camera 2.
CameraRigs MakeRigs(int num_frames) {
  CameraRigs rigs;
  rigs.cameras[1].is_reference = true;
  rigs.cameras[1].cam_from_rig = Rigid3d();
  rigs.cameras[2].cam_from_rig = kCam2FromCam1;
  for (int k = 1; k <= num_frames; ++k) {
    rigs.images[k] = {1, static_cast<uint32_t>(k)};
    rigs.images[100 + k] = {2, static_cast<uint32_t>(k)};
  }
  return rigs;
}

TEST(CameraRig, FramesHaveOnePriorForEachFurtherImage) {
  CameraRigs rigs = MakeRigs(3);
  rigs.images.erase(2);  // Without its reference image.
  rigs.cameras[2].rotation_sigma_rad = 1e-3;
  rigs.cameras[2].translation_sigma_m = 2e-3;
  const auto leaders = FindFrameLeaders(rigs);
  EXPECT_EQ(leaders.at(1), 1u);
  EXPECT_EQ(leaders.at(2), 102u);
  const std::vector<RelativePosePrior> priors = ComputeFramePriors(rigs);
  ASSERT_EQ(priors.size(), 2u);
  EXPECT_EQ(priors[1].image_id1, 3u);
  EXPECT_EQ(priors[1].image_id2, 103u);
  EXPECT_EQ(priors[1].dt_ns, 0);
  EXPECT_TRUE(PosesNear(priors[1].cam2_from_cam1, kCam2FromCam1, 1e-12, 1e-12));
  EXPECT_DOUBLE_EQ(priors[1].covariance(0, 0), 1e-6);
  EXPECT_DOUBLE_EQ(priors[1].covariance(5, 5), 4e-6);
}

TEST(CameraRig, UnknownCamerasAreEstimatedFromFrames) {
  Random random(1);
  CameraRigs rigs = MakeRigs(40);
  rigs.cameras[2].cam_from_rig.reset();
  EXPECT_TRUE(ComputeFramePriors(rigs).empty());
  std::map<image_t, Rigid3d> poses;
  for (int k = 1; k <= 40; ++k) {
    poses[k] = Rigid3d(ExpSo3(random.GaussianVector(1.0)),
                       random.GaussianVector(10.0));
    const Rigid3d error(ExpSo3(random.GaussianVector(0.01)),
                        random.GaussianVector(0.02));
    poses[100 + k] = error * kCam2FromCam1 * poses[k];
  }
  // A frame that was misplaced altogether.
  poses[120].translation += Eigen::Vector3d(5.0, 0.0, 0.0);
  std::map<image_t, Rigid3d> few(poses.begin(), std::next(poses.begin(), 42));
  EstimateUnknownRigCameras(few, &rigs);
  EXPECT_FALSE(rigs.cameras[2].cam_from_rig.has_value());
  EstimateUnknownRigCameras(poses, &rigs);
  ASSERT_TRUE(rigs.cameras[2].cam_from_rig.has_value());
  // Five sigmas of the mean of 40.
  EXPECT_TRUE(
      PosesNear(*rigs.cameras[2].cam_from_rig, kCam2FromCam1, 0.008, 0.02));
  EXPECT_NEAR(rigs.cameras[2].rotation_sigma_rad, 0.01 / std::sqrt(40), 0.003);
  EXPECT_EQ(ComputeFramePriors(rigs).size(), 40u);
}

}  // namespace
}  // namespace adasfm
