// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/align_to_positions.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 60;

// Upright cameras on a road of 300 m, in ENU and in another world frame.
struct Drive {
  PositionAlignmentInput input;
  Sim3d enu_from_world;
  std::map<image_t, Rigid3d> cams_from_enu;
  // The positions without the wrong ones.
  std::vector<PositionPrior> right_positions;
};

struct DriveOptions {
  double sigma_m = 1.0;
  double share_wrong = 0.0;
  bool is_straight = false;
  bool is_metric = true;
  bool has_gravity = true;
  Eigen::Vector3d antenna_in_cam = Eigen::Vector3d::Zero();
};

Drive MakeDrive(const DriveOptions& options, uint64_t seed) {
  Random random(seed);
  Drive drive;
  drive.enu_from_world =
      Sim3d(options.is_metric ? 1.0 : random.Uniform(0.1, 10.0),
            ExpSo3(random.GaussianVector(1.0)), random.GaussianVector(50.0));
  const Sim3d world_from_enu = drive.enu_from_world.Inverse();
  const Eigen::Vector3d jump = 15.0 * random.UnitVector();
  const int first_wrong =
      static_cast<int>(random.UniformInt(0, kNumImages / 2));
  for (int i = 0; i < kNumImages; ++i) {
    const double s = 5.0 * i;
    const double heading = options.is_straight ? 0.3 : 0.006 * s;
    const Eigen::Vector3d center =
        options.is_straight
            ? Eigen::Vector3d(s * std::cos(0.3), s * std::sin(0.3), 0.01 * s)
            : Eigen::Vector3d(std::sin(heading) / 0.006,
                              (1.0 - std::cos(heading)) / 0.006, 0.02 * s);
    // x right, y down, z forward.
    Eigen::Matrix3d enu_from_cam;
    enu_from_cam.col(2) << std::cos(heading), std::sin(heading), 0.0;
    enu_from_cam.col(1) = -Eigen::Vector3d::UnitZ();
    enu_from_cam.col(0) = enu_from_cam.col(1).cross(enu_from_cam.col(2));
    const Rigid3d pose = CamFromWorldWithCenter(
        Eigen::Quaterniond(enu_from_cam).conjugate(), center);
    drive.cams_from_enu[i] = pose;
    drive.input.cams_from_world[i] =
        TransformCamFromWorld(world_from_enu, pose);
    PositionPrior prior;
    prior.image_id1 = prior.image_id2 = i;
    prior.antenna_in_cam = options.antenna_in_cam;
    prior.position = center +
                     pose.rotation.conjugate() * options.antenna_in_cam +
                     random.GaussianVector(options.sigma_m);
    prior.covariance = std::max(1e-6, options.sigma_m * options.sigma_m) *
                       Eigen::Matrix3d::Identity();
    if (i >= first_wrong &&
        i < first_wrong + options.share_wrong * kNumImages) {
      prior.position += jump;
    } else {
      drive.right_positions.push_back(prior);
    }
    drive.input.positions.push_back(prior);
  }
  drive.input.is_metric = options.is_metric;
  if (options.has_gravity) {
    drive.input.down_in_world =
        world_from_enu.rotation * -Eigen::Vector3d::UnitZ();
  }
  return drive;
}

// The largest distance between true and aligned centres.
double MaxError(const Drive& drive, const PositionAlignment& alignment) {
  double max_error = 0.0;
  for (const auto& [image_id, pose] : drive.input.cams_from_world) {
    max_error = std::max(
        max_error, (alignment.enu_from_world * pose.TargetOriginInSource() -
                    drive.cams_from_enu.at(image_id).TargetOriginInSource())
                       .norm());
  }
  return max_error;
}

double RotationErrorDeg(const Drive& drive,
                        const PositionAlignment& alignment) {
  return RadToDeg(AngleBetweenRad(alignment.enu_from_world.rotation,
                                  drive.enu_from_world.rotation));
}

TEST(AlignToPositions, IsExactWithoutNoise) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    DriveOptions options;
    options.sigma_m = 0.0;
    options.is_metric = seed % 2 == 0;
    options.has_gravity = seed % 3 == 0;
    options.antenna_in_cam = {0.3, -1.5, -0.8};
    const Drive drive = MakeDrive(options, seed);
    const PositionAlignment alignment = AlignToPositions(drive.input);
    ASSERT_TRUE(alignment.success) << alignment.failure;
    EXPECT_LT(MaxError(drive, alignment), 1e-6);
    EXPECT_EQ(alignment.num_inliers, kNumImages);
  }
}

// The result equals that without the wrong positions: 15 m are so far beyond
// the range of Tukey's loss that these have no weight. With 60 positions of
// 1 m, a third of them wrong at one end, the far end is 200 m from the middle
// of the others and errs by 0.6 m in each of three directions; 2 m are two
// sigmas in space.
TEST(AlignToPositions, BridgesJumpsAndReflections) {
  for (const double share_wrong : {0.1, 0.35}) {
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      DriveOptions options;
      options.share_wrong = share_wrong;
      options.is_metric = seed % 2 == 0;
      options.has_gravity = seed % 4 < 2;
      const Drive drive = MakeDrive(options, seed);
      const PositionAlignment alignment = AlignToPositions(drive.input);
      ASSERT_TRUE(alignment.success) << alignment.failure;
      PositionAlignmentInput right = drive.input;
      right.positions = drive.right_positions;
      const PositionAlignment expected = AlignToPositions(right);
      ASSERT_TRUE(expected.success) << expected.failure;
      double max_difference = 0.0;
      for (const auto& [image_id, pose] : drive.input.cams_from_world) {
        const Eigen::Vector3d center = pose.TargetOriginInSource();
        max_difference =
            std::max(max_difference, (alignment.enu_from_world * center -
                                      expected.enu_from_world * center)
                                         .norm());
      }
      EXPECT_LT(MaxError(drive, alignment), 2.0) << seed << " " << share_wrong;
      EXPECT_LT(max_difference, 0.01) << seed << " " << share_wrong;
    }
  }
}

TEST(AlignToPositions, StraightRoadsKeepTheirRoll) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    DriveOptions options;
    options.is_straight = true;
    options.is_metric = false;
    options.has_gravity = seed % 2 == 0;
    const Drive drive = MakeDrive(options, seed);
    const PositionAlignment alignment = AlignToPositions(drive.input);
    ASSERT_TRUE(alignment.success) << alignment.failure;
    EXPECT_LT(RotationErrorDeg(drive, alignment), 3.0) << seed;
  }
}

TEST(AlignToPositions, SaysWhyItFails) {
  Drive drive = MakeDrive({}, 1);
  drive.input.positions.resize(2);
  EXPECT_NE(AlignToPositions(drive.input).failure.find("only 2 positions"),
            std::string::npos);
  // A stationary machine.
  drive = MakeDrive({}, 2);
  Random random(5);
  for (auto& [image_id, pose] : drive.input.cams_from_world) {
    pose = CamFromWorldWithCenter(pose.rotation, random.GaussianVector(0.2));
  }
  for (PositionPrior& prior : drive.input.positions) {
    prior.position = random.GaussianVector(1.0);
  }
  EXPECT_NE(AlignToPositions(drive.input).failure.find("too close together"),
            std::string::npos);
  // Latitude and longitude swapped: the trajectory is mirrored.
  DriveOptions options;
  drive = MakeDrive(options, 3);
  for (PositionPrior& prior : drive.input.positions) {
    std::swap(prior.position.x(), prior.position.y());
  }
  EXPECT_NE(AlignToPositions(drive.input).failure.find("different shapes"),
            std::string::npos);
}

}  // namespace
}  // namespace adasfm
