// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/trajectory_priors.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;
constexpr timestamp_t kSecondNs = 1'000'000'000;

// A body that drives a circle of 10 m at 1 m/s, ten poses a second.
Rigid3d BodyFromWorld(double time_s) {
  const double angle = 0.1 * time_s;
  const Eigen::Quaterniond world_from_body(
      Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  return Rigid3d(world_from_body, Eigen::Vector3d(10.0 * std::sin(angle),
                                                  -10.0 * std::cos(angle), 0.0))
      .Inverse();
}

std::vector<OdometryPose> Trajectory() {
  std::vector<OdometryPose> poses;
  for (int i = 0; i <= 100; ++i) {
    if (i > 40 && i < 60) continue;  // a gap of two seconds
    poses.push_back(
        {kStartNs + i * kSecondNs / 10, BodyFromWorld(0.1 * i).Inverse()});
  }
  return poses;
}

const Rigid3d kCamFromBody(
    Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitX())),
    Eigen::Vector3d(0.1, 0.2, 0.3));

std::vector<ImageStamp> Images() {
  std::vector<ImageStamp> images;
  for (image_t id = 1; id <= 24; ++id) {
    images.push_back(
        {id, "", kStartNs + (id - 3) * kSecondNs / 2 + kSecondNs / 20});
  }
  return images;
}

TEST(TrajectoryPriors, AreTheMotionsOfTheCameraWhereThereArePoses) {
  // The trajectory's clock is a twentieth of a second behind.
  const auto poses = InterpolateTrajectory(Trajectory(), kCamFromBody,
                                           -kSecondNs / 20, Images(), 0.5);
  // Not before its start, in its gap (4.5, 5.0, 5.5 s), or after its end.
  EXPECT_EQ(poses.size(), 21 - 3);
  TrajectoryPriorOptions options;
  options.sigma_m_per_m = 0.02;
  options.sigma_deg_per_m = 1.0;
  const auto priors = ComputeTrajectoryPriors(Images(), poses, options);
  ASSERT_EQ(priors.size(), 20 - 4);
  for (const RelativePosePrior& prior : priors) {
    const double time_s = 0.5 * (prior.image_id1 - 3.0);
    const Rigid3d truth =
        ComputeCam2FromCam1(kCamFromBody * BodyFromWorld(time_s),
                            kCamFromBody * BodyFromWorld(time_s + 0.5));
    EXPECT_LT((prior.cam2_from_cam1.translation - truth.translation).norm(),
              1e-6);
    EXPECT_LT(prior.cam2_from_cam1.rotation.angularDistance(truth.rotation),
              1e-6);
    EXPECT_EQ(prior.dt_ns, kSecondNs / 2);
    EXPECT_TRUE(prior.HasRotation() && prior.HasDirection() &&
                prior.HasLength());
    const double distance_m = truth.translation.norm();
    EXPECT_NEAR(std::sqrt(prior.covariance(5, 5)), 0.02 * distance_m, 1e-9);
    EXPECT_NEAR(std::sqrt(prior.covariance(0, 0)), DegToRad(1.0) * distance_m,
                1e-9);
  }
}

TEST(TrajectoryPriors, PosesBetweenOthersAreInterpolated) {
  const std::vector<ImageStamp> images = {{1, "", kStartNs + kSecondNs / 20},
                                          {2, "", kStartNs + kSecondNs / 8}};
  const auto poses =
      InterpolateTrajectory(Trajectory(), kCamFromBody, 0, images, 0.5);
  ASSERT_EQ(poses.size(), 2);
  const Rigid3d truth = kCamFromBody * BodyFromWorld(0.05);
  // Off by the chord of the arc, d^2 / (8 R) = 0.125 mm, and no more.
  EXPECT_LT((poses.at(1).translation - truth.translation).norm(), 1.26e-4);
  // Gaps longer than the limit are not bridged.
  EXPECT_TRUE(InterpolateTrajectory(Trajectory(), kCamFromBody, 0, images, 0.05)
                  .empty());
}

TEST(TrajectoryPriors, AtRestTheCovarianceKeepsAFloor) {
  const std::map<image_t, Rigid3d> poses = {{1, Rigid3d()}, {2, Rigid3d()}};
  const auto priors = ComputeTrajectoryPriors(
      {{1, "", kStartNs}, {2, "", kStartNs + 1}}, poses, {});
  ASSERT_EQ(priors.size(), 1);
  EXPECT_NEAR(std::sqrt(priors[0].covariance(3, 3)), 1e-3, 1e-12);
  EXPECT_NEAR(std::sqrt(priors[0].covariance(0, 0)), DegToRad(0.02), 1e-12);
}

TEST(TrajectoryPriors, OptionsAreChecked) {
  TrajectoryPriorOptions options;
  std::string error;
  EXPECT_TRUE(options.IsValid(&error));
  options.sigma_m_per_m = 0.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("sigma_m_per_m"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
