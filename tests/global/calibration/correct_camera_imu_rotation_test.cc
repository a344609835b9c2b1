// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/correct_camera_imu_rotation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

struct Drive {
  ViewGraph graph;
  GlobalCorrespondences correspondences;
  std::vector<RelativePosePrior> priors;
};

struct DriveOptions {
  // Rotation vector of the true camera from the stated one.
  Eigen::Vector3d camera_imu_deg = Eigen::Vector3d::Zero();
  // Largest rotation of a step.
  double turn_rad = 0.05;
  // Turns to one side only, instead of to both.
  bool turns_one_way = false;
  double noise_px = 0.5;
  // Whether priors of consecutive images have translations.
  bool has_positions = true;
  int num_images = 120;
};

constexpr double kFocalLengthPx = 500.0;

Bearing Observe(const Eigen::Vector3d& point_in_cam, double noise_px,
                Random* random) {
  const Eigen::Vector2d pixel =
      kFocalLengthPx * point_in_cam.hnormalized() +
      Eigen::Vector2d(random->Gaussian(noise_px), random->Gaussian(noise_px));
  const Eigen::Vector3d ray(pixel.x(), pixel.y(), kFocalLengthPx);
  Bearing bearing;
  bearing.direction = ray.normalized();
  const Eigen::Matrix3d project =
      (Eigen::Matrix3d::Identity() -
       bearing.direction * bearing.direction.transpose()) /
      ray.norm();
  bearing.jacobian = project.leftCols<2>();
  return bearing;
}

// Winding streets with 1 m and 0.1 s a step. Each pair of images up to five
// steps apart has matches of points 10 to 40 m ahead of its first image.
Drive BuildDrive(const DriveOptions& options, uint64_t seed) {
  Random random(seed);
  Drive drive;
  std::vector<Rigid3d> poses = {Rigid3d()};
  drive.graph.images = {1};
  const Eigen::Quaterniond stated_from_true =
      ExpSo3(-DegToRad(1.0) * options.camera_imu_deg);
  for (int k = 1; k < options.num_images; ++k) {
    const double share = std::sin(0.1 * k);
    const double turn_rad =
        options.turn_rad * (options.turns_one_way ? std::abs(share) : share);
    const Rigid3d step(ExpSo3(Eigen::Vector3d(0, turn_rad, 0)),
                       Eigen::Vector3d(0, 0, -1));
    poses.push_back(step * poses.back());
    drive.graph.images.push_back(k + 1);
    drive.priors.push_back(BuildPrior(k, k + 1, step, 2e-4, 5e-3, &random));
    RotatePrior(stated_from_true, &drive.priors.back());
    if (!options.has_positions) drive.priors.back().flags = kPriorRotation;
  }
  for (int i = 0; i < options.num_images; ++i) {
    for (int j = i + 1; j < std::min(options.num_images, i + 6); ++j) {
      Rigid3d motion = poses[j] * poses[i].Inverse();
      auto& bearings1 = drive.correspondences.bearings[i + 1];
      auto& bearings2 = drive.correspondences.bearings[j + 1];
      auto& matches = drive.correspondences.matches[ImagePair(i + 1, j + 1)];
      for (int k = 0; k < 100; ++k) {
        const Eigen::Vector3d point(random.Uniform(-10.0, 10.0),
                                    random.Uniform(-5.0, 5.0),
                                    random.Uniform(10.0, 40.0));
        matches.push_back({static_cast<point2D_t>(bearings1.size()),
                           static_cast<point2D_t>(bearings2.size())});
        bearings1.push_back(Observe(point, options.noise_px, &random));
        bearings2.push_back(Observe(motion * point, options.noise_px, &random));
      }
      constexpr double kRotationSigmaRad = 1e-3;
      motion.rotation =
          ExpSo3(random.GaussianVector(kRotationSigmaRad)) * motion.rotation;
      drive.graph.edges.push_back(BuildEdge(ImagePair(i + 1, j + 1), motion));
      drive.graph.edges.back().rotation_sigma_rad = kRotationSigmaRad;
    }
  }
  return drive;
}

// Rotates the direction of driving of all priors by this rotation vector.
void TurnDirections(const Eigen::Vector3d& turn, Drive* drive) {
  for (RelativePosePrior& prior : drive->priors) {
    Rigid3d& motion = prior.cam2_from_cam1;
    motion.translation = ExpSo3(turn) * motion.translation;
  }
}

CameraImuRotationReport Correct(Drive* drive,
                                const CameraImuRotationOptions& options) {
  return CorrectCameraImuRotation(
      options, OdometryChain(drive->priors, WithoutSharedErrors({})),
      drive->graph, drive->correspondences, &drive->priors);
}

// Scales the angles that the gyroscope measured.
void ScaleAngles(double factor, Drive* drive) {
  for (RelativePosePrior& prior : drive->priors) {
    Eigen::Quaterniond& rotation = prior.cam2_from_cam1.rotation;
    rotation = ExpSo3(factor * LogSo3(rotation));
  }
}

double ErrorDeg(const CameraImuRotationReport& report,
                const Eigen::Vector3d& truth) {
  return RadToDeg(AngleBetweenRad(ExpSo3(report.rotation_rad),
                                  ExpSo3(DegToRad(1.0) * truth)));
}

TEST(CorrectCameraImuRotation, FindsTheTurnAboutAllAxes) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    DriveOptions options;
    options.camera_imu_deg = Eigen::Vector3d(0.6, -1.0, 1.5);
    Drive drive = BuildDrive(options, seed);
    const Drive stated = drive;
    const CameraImuRotationReport report =
        Correct(&drive, CameraImuRotationOptions());
    ASSERT_TRUE(report.corrected) << "seed " << seed;
    // The error of 5e-3 in the direction of a step is 0.29 deg, and a tenth of
    // that for 120 steps. Rotations of 0.05 rad determine the roll to 1e-3 /
    // 0.1 with one pair and to a twentieth of that with all.
    EXPECT_LT(ErrorDeg(report, options.camera_imu_deg), 0.15)
        << "seed " << seed;
    EXPECT_LT(ErrorDeg(report, options.camera_imu_deg),
              4.0 * RadToDeg(report.sigma_rad));
    for (size_t k = 0; k < drive.priors.size(); ++k) {
      RelativePosePrior expected = stated.priors[k];
      RotatePrior(ExpSo3(report.rotation_rad), &expected);
      EXPECT_EQ(expected.cam2_from_cam1.translation,
                drive.priors[k].cam2_from_cam1.translation);
      EXPECT_EQ(expected.covariance, drive.priors[k].covariance);
    }
  }
}

TEST(CorrectCameraImuRotation, LeavesARightRotationAsItIs) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    Drive drive = BuildDrive(DriveOptions(), seed);
    const Drive before = drive;
    const CameraImuRotationReport report =
        Correct(&drive, CameraImuRotationOptions());
    EXPECT_FALSE(report.corrected) << "seed " << seed;
    EXPECT_LT(report.chi2, 16.0) << "seed " << seed;
    for (size_t k = 0; k < drive.priors.size(); ++k) {
      EXPECT_EQ(drive.priors[k].cam2_from_cam1.translation,
                before.priors[k].cam2_from_cam1.translation);
    }
  }
}

// On bends to one side, scaled rotations turn the directions of motion as an
// error of the camera-IMU rotation does: without an unknown of theirs, 2 %,
// which are two sigmas of it, look like 1 deg. The bound is that of
// FindsTheTurnAboutAllAxes.
TEST(CorrectCameraImuRotation, IsNotMisledByTheScaleOfTheGyroscope) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    for (const double factor : {0.98, 1.02}) {
      DriveOptions options;
      options.turn_rad = 0.15;
      options.turns_one_way = true;
      Drive drive = BuildDrive(options, seed);
      ScaleAngles(factor, &drive);
      const CameraImuRotationReport report =
          Correct(&drive, CameraImuRotationOptions());
      EXPECT_LT(RadToDeg(report.rotation_rad.norm()), 0.15)
          << "seed " << seed << ", " << factor;
      EXPECT_FALSE(report.corrected) << "seed " << seed << ", " << factor;
    }
  }
}

// A straight road leaves the roll open: it stays zero, the others are found.
TEST(CorrectCameraImuRotation, KeepsWhatAStraightRoadDoesNotTellAtZero) {
  DriveOptions options;
  options.camera_imu_deg = Eigen::Vector3d(0.6, -1.0, 1.5);
  options.turn_rad = 0.0;
  Drive drive = BuildDrive(options, 1);
  const CameraImuRotationReport report =
      Correct(&drive, CameraImuRotationOptions());
  ASSERT_TRUE(report.corrected);
  EXPECT_NEAR(RadToDeg(report.rotation_rad.z()), 0.0, 0.1);
  EXPECT_NEAR(RadToDeg(report.rotation_rad.x()), 0.6, 0.15);
  EXPECT_NEAR(RadToDeg(report.rotation_rad.y()), -1.0, 0.15);
}

// Without wheels the axis of the vehicle's turns still constrains the rotation.
TEST(CorrectCameraImuRotation, SeesTheAxisOfTurnsWithoutPositions) {
  DriveOptions options;
  options.camera_imu_deg = Eigen::Vector3d(2.0, 0.0, -3.0);
  options.has_positions = false;
  Drive drive = BuildDrive(options, 1);
  const CameraImuRotationReport report =
      Correct(&drive, CameraImuRotationOptions());
  ASSERT_TRUE(report.corrected);
  EXPECT_LT(ErrorDeg(report, options.camera_imu_deg), 0.6);
}

TEST(CorrectCameraImuRotation, OptionsDecide) {
  DriveOptions options;
  options.camera_imu_deg = Eigen::Vector3d(0.0, 0.7, 0.0);
  const Drive drive = BuildDrive(options, 3);
  const auto correct = [&](const CameraImuRotationOptions& changed) {
    Drive copy = drive;
    return Correct(&copy, changed);
  };
  const CameraImuRotationReport report = correct(CameraImuRotationOptions());
  EXPECT_TRUE(report.corrected);
  CameraImuRotationOptions changed;
  changed.enabled = false;
  EXPECT_FALSE(correct(changed).corrected);
  changed = CameraImuRotationOptions();
  changed.sigma_deg = 0.01;
  EXPECT_LT(correct(changed).rotation_rad.norm(),
            0.2 * report.rotation_rad.norm());
  std::string error;
  changed.sigma_deg = 0.0;
  EXPECT_FALSE(changed.IsValid(&error));
  EXPECT_NE(error.find("sigma_deg"), std::string::npos);
}

// The direction of driving is wrong, and the camera-IMU rotation is right or
// wrong. Bends about one axis cannot separate the yaws of the two, and the
// stated sigma must cover that. If the sigmas are right, 4 of 24 seeds exceed 3
// sigmas with a probability of 1e-6.
TEST(CorrectCameraImuRotation, SharesTheBlameWithTheDirectionOfDriving) {
  for (const double camera_imu_sigma_deg : {0.0, 1.0}) {
    int num_failures = 0;
    for (uint64_t seed = 1; seed <= 24; ++seed) {
      Random random(100 + seed);
      DriveOptions options;
      options.camera_imu_deg = random.GaussianVector(camera_imu_sigma_deg);
      Drive drive = BuildDrive(options, seed);
      // 1 sigma of the direction of driving in the odometry chain.
      const Eigen::Vector3d turn = random.GaussianVector(0.01);
      TurnDirections(turn, &drive);
      const CameraImuRotationReport report =
          Correct(&drive, CameraImuRotationOptions());
      // Error along the axis of the estimated rotation.
      const double error = report.rotation_rad.normalized().dot(
          report.rotation_rad - DegToRad(1.0) * options.camera_imu_deg);
      num_failures += std::abs(error) > 3.0 * report.sigma_rad;
      // A wrong direction of driving must not cause a tiny correction.
      EXPECT_TRUE(!report.corrected ||
                  RadToDeg(report.rotation_rad.norm()) >=
                      kMinNumCameraImuSigmas * kMinCameraImuSigmaDeg)
          << "seed " << seed;
    }
    EXPECT_LE(num_failures, 3)
        << "camera-IMU rotation " << camera_imu_sigma_deg;
  }
}

// Remaining errors of the camera-IMU rotation and of the direction of driving
// in the priors, in the frames that the priors were made with.
Eigen::Matrix<double, 6, 1> LeftInPriors(const CameraImuRotationReport& report,
                                         const Eigen::Vector3d& camera_imu_deg,
                                         const Eigen::Vector3d& driving) {
  const Eigen::Quaterniond error = ExpSo3(DegToRad(1.0) * camera_imu_deg);
  const Eigen::Quaterniond corrected = ExpSo3(
      report.corrected ? report.rotation_rad : Eigen::Vector3d(0.0, 0.0, 0.0));
  Eigen::Matrix<double, 6, 1> left;
  left << LogSo3(error * corrected.conjugate()),
      LogSo3(error * ExpSo3(-driving) * corrected.conjugate());
  return left;
}

// Camera-IMU rotation and direction of driving are both wrong. The remaining
// errors must agree with the stated covariance: 3 in 1,000 exceed this bound of
// the chi-square of 6 degrees of freedom, so 4 of 24 seeds exceed it with a
// probability of 1e-6. Vision must also constrain the angle between the
// direction of driving and the plane of the turns better than the prior does.
TEST(CorrectCameraImuRotation, TellsWhatIsLeftInThePriors) {
  constexpr double kChi2 = 20.06;
  constexpr double kDrivingSigmaRad = 0.01;
  for (const double camera_imu_sigma_deg : {0.0, 0.3, 1.0}) {
    int num_failures = 0;
    for (uint64_t seed = 1; seed <= 24; ++seed) {
      Random random(300 + seed);
      DriveOptions options;
      options.camera_imu_deg = random.GaussianVector(camera_imu_sigma_deg);
      Drive drive = BuildDrive(options, seed);
      const Eigen::Vector3d driving = random.GaussianVector(kDrivingSigmaRad);
      TurnDirections(driving, &drive);
      const CameraImuRotationReport report =
          Correct(&drive, CameraImuRotationOptions());
      ASSERT_TRUE(report.left_in_priors.has_value());
      const SharedRotationErrors& found = *report.left_in_priors;
      Eigen::Matrix<double, 6, 1> error =
          LeftInPriors(report, options.camera_imu_deg, driving);
      error.head<3>() -= found.camera_imu_rad;
      error.tail<3>() -= found.driving_direction_rad;
      num_failures += error.dot(found.covariance.ldlt().solve(error)) > kChi2;
      // The turns are about y, so the difference in x is the climb.
      Eigen::Matrix<double, 6, 1> climb = Eigen::Matrix<double, 6, 1>::Zero();
      climb(0) = -1.0;
      climb(3) = 1.0;
      EXPECT_LT(std::sqrt(climb.dot(found.covariance * climb)),
                0.3 * kDrivingSigmaRad)
          << "seed " << seed;
    }
    EXPECT_LE(num_failures, 3)
        << "camera-IMU rotation " << camera_imu_sigma_deg;
  }
}

TEST(CorrectCameraImuRotation, SaysNothingOfDirectionsThatPriorsDoNotHave) {
  DriveOptions options;
  options.has_positions = false;
  Drive drive = BuildDrive(options, 1);
  EXPECT_FALSE(Correct(&drive, CameraImuRotationOptions()).left_in_priors);
}

TEST(RotatePrior, KeepsWhatIsNotObservedInfinite) {
  Random random(1);
  RelativePosePrior prior = BuildPrior(1, 2, Rigid3d(), 1e-3, 1e-2, &random);
  prior.covariance.bottomRightCorner<3, 3>().diagonal().setConstant(
      std::numeric_limits<double>::infinity());
  RotatePrior(ExpSo3(Eigen::Vector3d(0.1, 0.2, 0.3)), &prior);
  EXPECT_FALSE(prior.covariance.hasNaN());
  EXPECT_EQ(prior.covariance(4, 4), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace adasfm
