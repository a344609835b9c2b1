// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/inertial_factors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/random.h"
#include "core/so3.h"
#include "global/calibration/correct_camera_imu_rotation.h"
#include "tests/testing/colmap_ext/mapper_drive.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

struct Parameters {
  std::array<AdjustedPose, 3> poses;
  Eigen::Vector3d gravity = Eigen::Vector3d(0.0, 0.0, -9.81);
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  double unit = 1.0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();

  std::vector<double*> Blocks() {
    return {poses[0].parameters, poses[1].parameters, poses[2].parameters,
            gravity.data(),      bias.data(),         &unit,
            turn.data()};
  }
  Eigen::Vector3d Residuals(const InertialCost& cost,
                            double** jacobians = nullptr) {
    for (AdjustedPose& pose : poses) pose.Update();
    Eigen::Vector3d residuals;
    EXPECT_TRUE(cost.Evaluate(Blocks().data(), residuals.data(), jacobians));
    return residuals;
  }
};

// Two consecutive inertial motions and the true poses of their three images.
struct ThreeImages {
  InertialMotion motion1, motion2;
  Parameters parameters;

  InertialCost Cost(double sigma) {
    return InertialCost(motion1, motion2, sigma, &parameters.poses[0],
                        &parameters.poses[1], &parameters.poses[2]);
  }
};

ThreeImages BuildThreeImages(uint64_t seed) {
  const MapperWorld world = BuildDrive(seed);
  InertialDriveOptions drive;
  drive.bias = Eigen::Vector3d(0.05, -0.1, 0.2);
  drive.lever = Eigen::Vector3d(0.3, -0.2, 1.0);
  const std::vector<InertialMotion> motions = IntegrateDrive(world, drive);
  const size_t k = 10 * seed;
  ThreeImages images;
  images.motion1 = motions[k];
  images.motion2 = motions[k + 1];
  images.parameters.bias = drive.bias;
  const std::array<image_t, 3> ids = {
      motions[k].image_id1, motions[k].image_id2, motions[k + 1].image_id2};
  for (int i = 0; i < 3; ++i) {
    images.parameters.poses[i] = AdjustedPose(world.true_poses.at(ids[i]));
  }
  return images;
}

TEST(InertialCost, IsZeroAtTheTruthInAnyUnit) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    ThreeImages images = BuildThreeImages(seed);
    EXPECT_LT(images.parameters.Residuals(images.Cost(1.0)).norm(), 1e-6)
        << "seed " << seed;
    const double unit = images.parameters.unit = 2.5;
    images.parameters.gravity *= unit;
    images.parameters.bias *= unit;
    for (AdjustedPose& pose : images.parameters.poses) {
      pose.initial_center *= unit;
    }
    EXPECT_LT(images.parameters.Residuals(images.Cost(1.0)).norm(), 1e-6)
        << "seed " << seed;
  }
}

TEST(InertialCost, DerivativesAreThoseOfDifferences) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    ThreeImages images = BuildThreeImages(seed);
    const InertialCost cost = images.Cost(0.1);
    Parameters& parameters = images.parameters;
    Random random(seed);
    const std::vector<int> sizes = {6, 6, 6, 3, 3, 1, 3};
    const std::vector<double*> blocks = parameters.Blocks();
    for (size_t k = 0; k < blocks.size(); ++k) {
      for (int i = 0; i < sizes[k]; ++i) blocks[k][i] += random.Gaussian(0.1);
    }
    for (size_t k = 0; k < blocks.size(); ++k) {
      std::vector<double> jacobian(3 * sizes[k]);
      std::vector<double*> jacobians(blocks.size(), nullptr);
      jacobians[k] = jacobian.data();
      parameters.Residuals(cost, jacobians.data());
      for (int i = 0; i < sizes[k]; ++i) {
        constexpr double kStep = 1e-5;
        const double value = blocks[k][i];
        blocks[k][i] = value + kStep;
        const Eigen::Vector3d above = parameters.Residuals(cost);
        blocks[k][i] = value - kStep;
        const Eigen::Vector3d below = parameters.Residuals(cost);
        blocks[k][i] = value;
        for (int row = 0; row < 3; ++row) {
          const double numeric = (above - below)[row] / (2.0 * kStep);
          EXPECT_NEAR(jacobian[row * sizes[k] + i], numeric,
                      1e-5 * (1.0 + std::abs(numeric)))
              << "block " << k << ", column " << i;
        }
      }
    }
  }
}

// T_cam_imu has a wrong rotation, which the parameter `turn` compensates. The
// remaining residual is of second order: gravity rotated by the square of half
// a degree.
TEST(InertialCost, KnowsTheTurnOfTheImu) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    ThreeImages images = BuildThreeImages(seed);
    const double sigma = images.motion1.dt_s;  // residuals in m/s^2
    const Eigen::Vector3d turn = DegToRad(0.5) * Random(seed).UnitVector();
    images.motion1.camera_from_imu_origin.setZero();
    images.motion2.camera_from_imu_origin.setZero();
    const Eigen::Vector3d before =
        images.parameters.Residuals(images.Cost(sigma));
    RotateInertialMotion(ExpSo3(-turn), &images.motion1);
    RotateInertialMotion(ExpSo3(-turn), &images.motion2);
    images.parameters.bias = ExpSo3(-turn) * images.parameters.bias;
    const double unknown =
        (images.parameters.Residuals(images.Cost(sigma)) - before).norm();
    images.parameters.turn = turn;
    images.parameters.bias = ExpSo3(turn) * images.parameters.bias;
    const double known =
        (images.parameters.Residuals(images.Cost(sigma)) - before).norm();
    EXPECT_LT(known, 2.0 * 12.0 * turn.squaredNorm()) << "seed " << seed;
    EXPECT_GT(unknown, 10.0 * known) << "seed " << seed;
  }
}

// A drive without wheels: only the rotations of its priors are used.
PriorBundleAdjustmentProblem ProblemWithoutWheels(
    const MapperWorld& world, const colmap::Reconstruction& model) {
  PriorBundleAdjustmentProblem problem = ProblemOf(world, model);
  problem.priors.clear();
  for (RelativePosePrior prior : world.data.priors) {
    prior.flags &= kPriorRotation;
    problem.priors.push_back(PosePriorEdgeFromPrior(prior));
  }
  return problem;
}

// Keeps only a few of the points that images up to `last` share with later
// ones.
void TearAt(image_t last, colmap::Reconstruction* model) {
  const auto ids = model->Point3DIds();
  std::vector<colmap::point3D_t> point_ids(ids.begin(), ids.end());
  std::sort(point_ids.begin(), point_ids.end());
  int num_kept = 8;
  for (const colmap::point3D_t point_id : point_ids) {
    bool is_before = false, is_behind = false;
    for (const auto& element : model->Point3D(point_id).Track().Elements()) {
      (element.image_id <= last ? is_before : is_behind) = true;
    }
    if (is_before && is_behind && --num_kept < 0) {
      model->DeletePoint3D(point_id);
    }
  }
}

double RmseM(const MapperWorld& world, const colmap::Reconstruction& model) {
  return ComputeAlignedErrors(CamsFromWorld(model), world.true_poses, {})
      .rmse_m;
}

PriorBundleAdjustmentSummary Adjust(const PriorBundleAdjustmentProblem& problem,
                                    colmap::Reconstruction* model) {
  PriorBundleAdjustmentOptions options;
  options.function_tolerance = 1e-6;
  double factor = 1.0;
  return AdjustBundleWithVarianceComponents({}, options, problem, model,
                                            &factor);
}

// The residuals determine the accelerometer's noise, though that of vision is
// several times larger. Some 60 of 350 residuals are due to the accelerometer:
// 1 sigma of the noise is 0.1 of it, and as much is added as a safety margin.
TEST(InertialFactors, FindTheNoiseOfTheAccelerometer) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    const colmap::Reconstruction start = Reconstruct(world);
    for (const double noise : {0.01, 0.03}) {
      PriorBundleAdjustmentProblem problem = ProblemWithoutWheels(world, start);
      InertialDriveOptions drive;
      drive.noise = noise;
      drive.bias = Eigen::Vector3d(0.05, -0.1, 0.2);
      drive.seed = seed;
      problem.inertial_motions = IntegrateDrive(world, drive);
      colmap::Reconstruction model = start;
      const PriorBundleAdjustmentSummary summary = Adjust(problem, &model);
      ASSERT_TRUE(summary.success);
      const double found =
          summary.accelerometer_noise *
          summary
              .prior_sigma_factors[static_cast<size_t>(PriorTerm::kVelocity)];
      EXPECT_GT(found, 0.8 * noise) << "seed " << seed;
      EXPECT_LT(found, 1.5 * noise) << "seed " << seed;
    }
  }
}

// Two halves of a drive that few points connect drift apart. The accelerometer
// corrects this, and its noise does not degrade a sound model.
TEST(InertialFactors, CloseATearAndLeaveTheRest) {
  double torn = 0.0, mended = 0.0, sound = 0.0, sound_mended = 0.0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    const colmap::Reconstruction whole = Reconstruct(world);
    InertialDriveOptions drive;
    drive.noise = 0.01;
    drive.seed = seed;
    const std::vector<InertialMotion> motions = IntegrateDrive(world, drive);
    for (const bool is_torn : {false, true}) {
      colmap::Reconstruction start = whole;
      if (is_torn) TearAt(60, &start);
      PriorBundleAdjustmentProblem problem = ProblemWithoutWheels(world, start);
      colmap::Reconstruction without = start;
      ASSERT_TRUE(Adjust(problem, &without).success);
      problem.inertial_motions = motions;
      colmap::Reconstruction with = start;
      ASSERT_TRUE(Adjust(problem, &with).success);
      (is_torn ? torn : sound) += RmseM(world, without);
      (is_torn ? mended : sound_mended) += RmseM(world, with);
    }
  }
  EXPECT_LT(mended, 0.5 * torn);
  EXPECT_LT(sound_mended, 1.05 * sound);
}

// The vehicle rotates about the vertical only. The gyroscope does not observe a
// camera-IMU rotation about that axis, and the directions of driving have an
// unknown rotation of their own. Noise of 0.01 over 24 s at 2 m/s^2 leaves
// 0.06 deg.
TEST(InertialFactors, TellHowTheImuIsTurned) {
  double error = 0.0, error_without = 0.0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    const colmap::Reconstruction start = Reconstruct(world);
    const double angle = DegToRad(seed % 2 == 0 ? 0.4 : -0.4);
    const Eigen::Quaterniond stated = ExpSo3(angle * -Eigen::Vector3d::UnitY());
    InertialDriveOptions drive;
    drive.noise = 0.01;
    drive.seed = seed;
    std::vector<InertialMotion> motions = IntegrateDrive(world, drive);
    PriorBundleAdjustmentProblem problem = ProblemOf(world, start);
    problem.priors.clear();
    for (size_t i = 0; i < world.data.priors.size(); ++i) {
      RelativePosePrior prior = world.data.priors[i];
      RotatePrior(stated, &prior);
      problem.priors.push_back(PosePriorEdgeFromPrior(prior));
      RotateInertialMotion(stated, &motions[i]);
      motions[i].by_wheels =
          MeasuredTranslation{prior.cam2_from_cam1.translation,
                              prior.covariance.bottomRightCorner<3, 3>()};
    }
    const auto rotation_error = [&](const PriorBundleAdjustmentSummary& found) {
      return std::abs(found.shared_errors.extrinsic_rotation.at(0).y() - angle);
    };
    colmap::Reconstruction model = start;
    error_without += rotation_error(Adjust(problem, &model)) / 5.0;
    problem.inertial_motions = motions;
    model = start;
    error += rotation_error(Adjust(problem, &model)) / 5.0;
  }
  RecordProperty("deg", std::to_string(RadToDeg(error)));
  EXPECT_LT(error, DegToRad(0.1));
  EXPECT_GT(error_without, 2.0 * error);
}

// The wheels' translation replaces the smoothed one, or none does at wheel
// slips and across gaps of a drive without wheels. Nothing changes for motions
// in no factor, for lengths found by vision, and for too few motions.
TEST(LeaveAccelerometerToFactors, ReplacesWhatTheFactorsHold) {
  constexpr image_t kBridge = 7;  // across a gap, by the accelerometer
  std::vector<InertialMotion> motions;
  std::vector<RelativePosePrior> priors;
  std::set<image_t> images;
  Random random(1);
  for (image_t image_id = 1; image_id <= 20; ++image_id) {
    RelativePosePrior prior;
    prior.image_id1 = image_id;
    prior.image_id2 = image_id + 1;
    prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
    prior.cam2_from_cam1.translation = random.GaussianVector(1.0);
    if (image_id == 3) {
      prior.flags = kPriorRotation | kPriorLength | kPriorInertialLength;
    }
    if (image_id == kBridge) prior.flags |= kPriorInertialLength;
    priors.push_back(prior);
    InertialMotion motion;
    motion.image_id1 = image_id;
    motion.image_id2 = image_id + 1;
    motion.dt_s = 0.2;
    if (image_id != 5 && image_id != kBridge) {
      motion.by_wheels = MeasuredTranslation{
          random.GaussianVector(1.0), 0.04 * Eigen::Matrix3d::Identity()};
    }
    motions.push_back(motion);
    // 18 has no neighbour with a pose: 17-18 and 18-19 are in no factor.
    if (image_id != 17 && image_id != 19) images.insert(image_id);
  }
  const auto left = LeaveAccelerometerToFactors(motions, images, priors);
  ASSERT_EQ(left.size(), priors.size());
  for (size_t i = 0; i < priors.size(); ++i) {
    const Eigen::Vector3d& translation = left[i].cam2_from_cam1.translation;
    const Eigen::Matrix3d covariance =
        left[i].covariance.bottomRightCorner<3, 3>();
    EXPECT_EQ((left[i].covariance.topLeftCorner<3, 3>()),
              (priors[i].covariance.topLeftCorner<3, 3>()));
    const image_t image_id = priors[i].image_id1;
    if (image_id == 5 || image_id == kBridge) {
      EXPECT_EQ(left[i].flags, kPriorRotation);
    } else if (image_id == 3 || image_id >= 16) {
      EXPECT_EQ(translation, priors[i].cam2_from_cam1.translation);
      EXPECT_EQ(left[i].flags, priors[i].flags);
    } else {
      EXPECT_EQ(translation, motions[i].by_wheels->translation);
      EXPECT_EQ(covariance, motions[i].by_wheels->covariance);
      EXPECT_EQ(left[i].flags, priors[i].flags);
    }
  }
  const auto few = LeaveAccelerometerToFactors(motions, {1, 2, 3, 4}, priors);
  EXPECT_EQ(few[1].cam2_from_cam1.translation,
            priors[1].cam2_from_cam1.translation);
}

}  // namespace
}  // namespace adasfm
