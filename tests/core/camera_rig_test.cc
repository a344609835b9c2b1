// SPDX-License-Identifier: BSD-3-Clause
#include "core/camera_rig.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

const Rigid3d kCam2FromCam1(ExpSo3(Eigen::Vector3d(0.02, -0.4, 0.01)),
                            Eigen::Vector3d(-0.5, 0.02, 0.1));

// Frame k = 1, 2, ... has image k of camera 1, the reference, and image 100 + k
// of camera 2.
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

// Without the reference camera the leader's calibrated pose has errors, too:
// the covariance must agree with drawn errors of both cameras.
TEST(CameraRig, CovarianceHasTheErrorsOfTheLeader) {
  constexpr int kNumDraws = 20000;
  CameraRigs rigs = MakeRigs(1);
  rigs.images.erase(1);
  rigs.images[201] = {3, 1};
  rigs.cameras[3].cam_from_rig = Rigid3d(
      ExpSo3(Eigen::Vector3d(-0.3, 0.8, 0.2)), Eigen::Vector3d(0.4, -0.1, 0.6));
  rigs.cameras[2].rotation_sigma_rad = 2e-3;
  rigs.cameras[2].translation_sigma_m = 1e-3;
  rigs.cameras[3].rotation_sigma_rad = 1e-3;
  rigs.cameras[3].translation_sigma_m = 3e-3;
  const std::vector<RelativePosePrior> priors = ComputeFramePriors(rigs);
  ASSERT_EQ(priors.size(), 1u);
  EXPECT_EQ(priors[0].image_id1, 101u);
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    const auto draw = [&](const RigCamera& camera) {
      const Rigid3d& pose = *camera.cam_from_rig;
      return Rigid3d(
          ExpSo3(random.GaussianVector(camera.rotation_sigma_rad)) *
              pose.rotation,
          pose.translation + random.GaussianVector(camera.translation_sigma_m));
    };
    Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
    for (int k = 0; k < kNumDraws; ++k) {
      const Rigid3d drawn =
          ComputeCam2FromCam1(draw(rigs.cameras[2]), draw(rigs.cameras[3]));
      Eigen::Matrix<double, 6, 1> error;
      error << LogSo3(drawn.rotation *
                      priors[0].cam2_from_cam1.rotation.conjugate()),
          drawn.translation - priors[0].cam2_from_cam1.translation;
      sum += error * error.transpose() / kNumDraws;
    }
    // In units of the stated sigmas. Entries of a sample covariance vary by at
    // most sqrt(2 / n), here 0.01; the tolerance is five times that.
    const Eigen::Matrix<double, 6, 6> whitening =
        priors[0].covariance.llt().matrixL().solve(
            Eigen::Matrix<double, 6, 6>::Identity());
    const Eigen::Matrix<double, 6, 6> whitened =
        whitening * sum * whitening.transpose();
    EXPECT_LT((whitened - Eigen::Matrix<double, 6, 6>::Identity())
                  .cwiseAbs()
                  .maxCoeff(),
              0.05)
        << whitened;
  }
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
