// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

TEST(SyntheticPriors, ErrorsMatchTheirCovarianceOverTwentySeeds) {
  double chi2 = 0.0;
  constexpr int kNumSeeds = 20;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed);
    options.wheel_scale = seed % 2 == 0 ? 1.01 : 0.995;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Dataset data = ToDataset(world);
    const PriorEstimate estimate = EstimateOrThrow(data);
    EXPECT_EQ(estimate.summary.num_priors, options.num_images - 1);
    chi2 += ComputePairErrors(estimate, data.cams_from_world).chi2 / kNumSeeds;
    EXPECT_NEAR(estimate.summary.wheel_scale, options.wheel_scale,
                4.0 * estimate.summary.wheel_scale_sigma);
    EXPECT_TRUE(estimate.summary.warnings.empty());
  }
  RecordProperty("chi2", std::to_string(chi2));
  EXPECT_GT(chi2, 0.8);
  EXPECT_LT(chi2, 1.25);
}

TEST(SyntheticPriors, LongerDrivesTellTheWheelScale) {
  double squares = 0.0;
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    SyntheticWorldOptions options = SmallWorld(seed, 250);
    options.wheel_scale = 1.02;
    const Dataset data = ToDataset(BuildSyntheticWorld(options));
    const double error = EstimateOrThrow(data).summary.wheel_scale - 1.02;
    squares += error * error / 5.0;
  }
  EXPECT_LT(std::sqrt(squares), 0.003);
}

// A scale factor of noisy readings would be estimated too small, one of
// estimated motion is not (sensors/smoother/odometry_factors.h).
TEST(SyntheticPriors, NoisyWheelsDoNotShrinkTheScale) {
  constexpr int kNumSeeds = 8;
  double error = 0.0, variance = 0.0;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    // Many short links, and little else that constrains the scale.
    SyntheticWorldOptions options = SmallWorld(seed, 400);
    options.spacing_m = 0.3;
    options.wheel_speed_noise = 0.5;
    const Dataset data = ToDataset(BuildSyntheticWorld(options));
    PriorEstimationOptions prior_options;
    prior_options.fusion.wheel_scale_sigma = 0.1;
    const StatusOr<PriorEstimate> estimate = EstimatePriors(
        data.images, data.logs, data.calibration, {}, prior_options);
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    const SensorSummary& summary = estimate->summary;
    error += (summary.wheel_scale - options.wheel_scale) / kNumSeeds;
    variance += summary.wheel_scale_sigma * summary.wheel_scale_sigma /
                (kNumSeeds * kNumSeeds);
  }
  EXPECT_NEAR(error, 0.0, 3.0 * std::sqrt(variance));
}

// Removes the IMU samples of the standstill before the first image.
Dataset WithoutStandstill(Dataset data) {
  const timestamp_t start = data.images.front().timestamp_ns;
  while (data.logs.imu.front().timestamp_ns < start - 20'000'000) {
    data.logs.imu.erase(data.logs.imu.begin());
  }
  return data;
}

TEST(SyntheticPriors, StartsWithoutStandstill) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options = SmallWorld(seed);
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Dataset data = WithoutStandstill(ToDataset(world));
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed), {});
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    EXPECT_EQ(estimate->summary.standstill_s, 0.0);
    // Vision determines the bias to 1e-3 rad over 79 pairs of 0.2 s.
    EXPECT_LT((estimate->summary.gyroscope_bias - world.true_gyro_bias).norm(),
              0.004);
    const PairErrors errors =
        ComputePairErrors(*estimate, data.cams_from_world);
    EXPECT_GT(errors.chi2, 0.4);
    EXPECT_LT(errors.chi2, 2.0);
  }
}

// Checks the priors of a drive with a stop that has an image each interval.
// Returns the chi-square of all priors per degree of freedom.
double CheckDriveWithStop(double stop_s, double image_interval_s,
                          uint64_t seed) {
  SyntheticWorldOptions options = SmallWorld(seed, 120);
  options.imu_rate_hz = 50.0;
  options.num_stops = 1;
  options.stop_duration_s = stop_s;
  options.stop_image_interval_s = image_interval_s;
  const Dataset data = ToDataset(BuildSyntheticWorld(options));
  const PriorEstimate estimate = EstimateOrThrow(data);
  EXPECT_TRUE(estimate.summary.warnings.empty()) << "seed " << seed;
  EXPECT_EQ(estimate.summary.num_priors, options.num_images - 1);
  EXPECT_NEAR(estimate.summary.standstill_s, stop_s + 3.0, 3.0);
  std::map<image_t, timestamp_t> times_ns;
  for (const ImageStamp& image : data.images) {
    times_ns[image.image_id] = image.timestamp_ns;
  }
  for (const RelativePosePrior& prior : estimate.priors) {
    const timestamp_t step_ns =
        times_ns.at(prior.image_id2) - times_ns.at(prior.image_id1);
    if (step_ns < NsFromSeconds(0.5 * std::min(stop_s, image_interval_s))) {
      EXPECT_EQ(prior.dt_ns, step_ns);
      continue;
    }
    // What it drives and brakes besides.
    EXPECT_LT(prior.dt_ns, NsFromSeconds(5.0));
    EXPECT_EQ(prior.flags, kPriorRotation | kPriorDirection | kPriorLength);
    // The global stage asks for 1 deg and 0.05 m, or 5 % of the step.
    const Rigid3d truth =
        ComputeCam2FromCam1(data.cams_from_world.at(prior.image_id1),
                            data.cams_from_world.at(prior.image_id2));
    const Eigen::Matrix<double, 6, 1> sigmas =
        prior.covariance.diagonal().cwiseSqrt();
    EXPECT_LT(sigmas.head<3>().maxCoeff(), DegToRad(1.0));
    EXPECT_LT(sigmas.tail<3>().maxCoeff(),
              std::max(0.05, 0.05 * truth.translation.norm()));
    if (truth.translation.norm() > 1e-6) continue;
    EXPECT_LT(prior.cam2_from_cam1.translation.norm(),
              3.0 * sigmas.tail<3>().maxCoeff());
    EXPECT_LT(LogSo3(prior.cam2_from_cam1.rotation).norm(),
              3.0 * sigmas.head<3>().maxCoeff());
  }
  return ComputePairErrors(estimate, data.cams_from_world).chi2;
}

// A gyroscope integrated for an hour drifts by radians. The machine is where it
// was, and the drive beyond has the errors of any other.
TEST(SyntheticPriors, HoursAtRestAreOneStep) {
  for (const double image_interval_s : {600.0, 7200.0}) {
    const double chi2 = 0.5 * (CheckDriveWithStop(3600.0, image_interval_s, 1) +
                               CheckDriveWithStop(3600.0, image_interval_s, 2));
    EXPECT_GT(chi2, 0.5);
    EXPECT_LT(chi2, 1.6);
  }
}

TEST(SyntheticPriors, MinutesAtRestAreOneStep) {
  const double chi2 = CheckDriveWithStop(180.0, 1000.0, 1);
  EXPECT_GT(chi2, 0.4);
  EXPECT_LT(chi2, 2.0);
}

// Rolling shutters and poor geometries rotate pairs of any gap alike: no bias.
TEST(SyntheticPriors, WhatAllTwoViewRotationsErrByIsNoBias) {
  const Eigen::Quaterniond offset =
      ExpSo3(Eigen::Vector3d(4e-4, -1.2e-3, 6e-4));
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 200));
    const Dataset data = WithoutStandstill(ToDataset(world));
    std::vector<VisualRotation> vision =
        SimulateVision(world, seed, {1.5e-3, 3});
    for (VisualRotation& rotation : vision) {
      rotation.cam2_from_cam1 = offset * rotation.cam2_from_cam1;
    }
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration, vision, {});
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    const SensorSummary& summary = estimate->summary;
    // About the vertical nothing but vision constrains the bias.
    const double error = (summary.gyroscope_bias - world.true_gyro_bias).z();
    EXPECT_LT(std::abs(error),
              3.0 * std::sqrt(summary.gyroscope_bias_covariance(2, 2)))
        << "seed " << seed;
  }
}

TEST(SyntheticPriors, VisionCanBeSwitchedOff) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(2));
  const Dataset data = WithoutStandstill(ToDataset(world));
  PriorEstimationOptions options;
  const std::vector<VisualRotation> vision =
      SimulateVision(world, 2, {1e-3, 3});
  const auto estimate = [&] {
    return *EstimatePriors(data.images, data.logs, data.calibration, vision,
                           options);
  };
  const double unaided_sigma =
      EstimateOrThrow(data).summary.gyroscope_bias_sigma;
  EXPECT_LT(estimate().summary.gyroscope_bias_sigma, 0.8 * unaided_sigma);
  options.use_visual_rotations = false;
  EXPECT_EQ(estimate().summary.gyroscope_bias_sigma, unaided_sigma);
  EXPECT_EQ(estimate().priors[40].covariance,
            EstimateOrThrow(data).priors[40].covariance);
}

TEST(SyntheticPriors, SlipsAreFoundAndTheLengthStays) {
  for (const uint64_t seed : {3, 4, 5}) {
    SyntheticWorldOptions options = SmallWorld(seed, 150);
    options.num_wheel_slips = 2;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Dataset data = ToDataset(world);
    const PriorEstimate estimate = EstimateOrThrow(data);
    for (const auto& [start, end] : world.wheel_slips) {
      double overlap = 0.0;
      for (const WheelSlip& slip : estimate.summary.wheel_slips) {
        overlap += std::max(0.0, SecondsFromNs(std::min(end, slip.end_ns) -
                                               std::max(start, slip.start_ns)));
      }
      EXPECT_GT(overlap, 0.7 * SecondsFromNs(end - start)) << "seed " << seed;
    }
    const PairErrors errors = ComputePairErrors(estimate, data.cams_from_world);
    EXPECT_NEAR(errors.length_ratio, 1.0, 0.01) << "seed " << seed;
  }
}

// Wheels that slip until the log ends show one jump. All later readings are
// wrong, too, though the accelerometer agrees with them.
TEST(SyntheticPriors, ASlipUntilTheEndIsFound) {
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(seed, 60)));
    const timestamp_t begin_ns = data.images.back().timestamp_ns - 1200000000;
    for (WheelSample& sample : data.logs.wheel) {
      if (sample.timestamp_ns < begin_ns) continue;
      sample.first *= 1.5;
      sample.second *= 1.5;
    }
    const PriorEstimate estimate = EstimateOrThrow(data);
    ASSERT_FALSE(estimate.summary.wheel_slips.empty()) << "seed " << seed;
    EXPECT_LT(std::abs(SecondsFromNs(
                  estimate.summary.wheel_slips.front().start_ns - begin_ns)),
              0.5)
        << "seed " << seed;
    const PairErrors errors = ComputePairErrors(estimate, data.cams_from_world);
    EXPECT_NEAR(errors.length_ratio, 1.0, 0.01) << "seed " << seed;
  }
}

TEST(SyntheticPriors, GravityPointsDown) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(6));
  const Dataset data = ToDataset(world);
  const PriorEstimate estimate = EstimateOrThrow(data);
  for (const auto& [image_id, gravity] : estimate.gravity_in_cam) {
    const Eigen::Vector3d truth =
        data.cams_from_world.at(image_id).rotation * -Eigen::Vector3d::UnitZ();
    // The accelerometer's bias of 0.03 m/s^2 is 0.2 deg of tilt.
    EXPECT_LT(RadToDeg(AngleBetweenRad(gravity, truth)), 1.0);
  }
  EXPECT_EQ(estimate.gravity_in_cam.size(), data.images.size());
}

TEST(SyntheticPriors, ImuAloneClaimsRotationOnly) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(7)));
  data.calibration.has_wheel = false;
  data.logs.wheel.clear();
  const PriorEstimate estimate = EstimateOrThrow(data);
  ASSERT_EQ(estimate.priors.size(), data.images.size() - 1);
  for (const RelativePosePrior& prior : estimate.priors) {
    EXPECT_EQ(prior.flags, static_cast<uint32_t>(kPriorRotation));
    EXPECT_TRUE(std::isinf(prior.covariance(3, 3)));
    EXPECT_TRUE(std::isfinite(prior.covariance(0, 0)));
  }
  const PairErrors errors = ComputePairErrors(estimate, data.cams_from_world);
  EXPECT_LT(errors.rotation_rms_deg, 0.05);
  EXPECT_FALSE(estimate.gravity_in_cam.empty());
}

// Eliminates the speed from the equations of core/inertial_motion.h with the
// positions of three images; with wheels for odd seeds.
TEST(SyntheticPriors, StoreWhatTheImuIntegrates) {
  const Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  for (const uint64_t seed : {1, 2, 3, 4, 5}) {
    SCOPED_TRACE(seed);
    Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(seed)));
    if (seed % 2 == 0) {
      data.calibration.has_wheel = false;
      data.logs.wheel.clear();
    }
    const PriorEstimate estimate = EstimateOrThrow(data);
    const std::vector<InertialMotion>& motions = estimate.inertial_motions;
    ASSERT_EQ(motions.size(), estimate.priors.size());
    const auto imu_position = [&](image_t image_id, const InertialMotion& m) {
      const Rigid3d world_from_cam =
          data.cams_from_world.at(image_id).Inverse();
      return Eigen::Vector3d(world_from_cam.translation -
                             world_from_cam.rotation *
                                 m.camera_from_imu_origin);
    };
    for (size_t i = 0; i + 1 < motions.size(); ++i) {
      const InertialMotion& a = motions[i];
      const InertialMotion& b = motions[i + 1];
      EXPECT_EQ(a.image_id1, estimate.priors[i].image_id1);
      ASSERT_EQ(a.image_id2, b.image_id1);
      EXPECT_NEAR(a.dt_s, SecondsFromNs(estimate.priors[i].dt_ns), 1e-9);
      const Eigen::Quaterniond rotation1 =
          data.cams_from_world.at(a.image_id1).rotation.conjugate();
      const Eigen::Quaterniond rotation2 =
          data.cams_from_world.at(b.image_id1).rotation.conjugate();
      const Eigen::Vector3d p1 = imu_position(a.image_id1, a);
      const Eigen::Vector3d p2 = imu_position(b.image_id1, a);
      const Eigen::Vector3d p3 = imu_position(b.image_id2, a);
      const Eigen::Vector3d speed_change =
          (p3 - p2) / b.dt_s - (p2 - p1) / a.dt_s;
      const Eigen::Vector3d expected =
          0.5 * gravity * (a.dt_s + b.dt_s) +
          rotation2 * b.delta_position / b.dt_s +
          rotation1 * (a.delta_velocity - a.delta_position / a.dt_s);
      // The accelerometer's bias is 0.03 m/s^2 on each axis.
      EXPECT_LT((speed_change - expected).norm(), 0.1 * (a.dt_s + b.dt_s));
    }
  }
}

TEST(SyntheticPriors, SpeedAloneClaimsLengthOnly) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(8)));
  data.calibration.has_imu = false;
  data.calibration.wheel_type = WheelType::kSpeed;
  data.logs.imu.clear();
  for (WheelSample& sample : data.logs.wheel) {
    sample.first = 0.5 * (sample.first + sample.second);
  }
  const PriorEstimate estimate = EstimateOrThrow(data);
  ASSERT_EQ(estimate.priors.size(), data.images.size() - 1);
  double length = 0.0, true_length = 0.0;
  for (const RelativePosePrior& prior : estimate.priors) {
    EXPECT_EQ(prior.flags, static_cast<uint32_t>(kPriorLength));
    EXPECT_TRUE(std::isinf(prior.covariance(0, 0)));
    length += prior.cam2_from_cam1.translation.norm();
    true_length += ComputeCam2FromCam1(data.cams_from_world.at(prior.image_id1),
                                       data.cams_from_world.at(prior.image_id2))
                       .translation.norm();
  }
  EXPECT_TRUE(estimate.gravity_in_cam.empty());
  // Beside the wheels' axis, the camera moves differently in bends.
  EXPECT_NEAR(length / true_length, 1.0, 0.03);
}

TEST(SyntheticPriors, WheelsAloneGivePlanarMotion) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(9)));
  data.calibration.has_imu = false;
  data.logs.imu.clear();
  const PriorEstimate estimate = EstimateOrThrow(data);
  for (const RelativePosePrior& prior : estimate.priors) {
    EXPECT_TRUE(prior.HasRotation() && prior.HasDirection() &&
                prior.HasLength());
  }
  const PairErrors errors = ComputePairErrors(estimate, data.cams_from_world);
  EXPECT_NEAR(errors.length_ratio, 1.0, 0.01);
  EXPECT_LT(errors.rotation_rms_deg, 1.5);
}

TEST(SyntheticPriors, TrajectoryAloneGivesEverything) {
  const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(10));
  Dataset data = ToDataset(world);
  data.logs = SensorLogs();
  data.calibration.has_imu = false;
  data.calibration.wheel_type = WheelType::kOdometry;
  for (const SyntheticImage& image : world.images) {
    const Rigid3d world_from_body = image.cam_from_world.Inverse() *
                                    world.cam_from_imu * world.imu_from_wheel;
    data.logs.odometry.push_back({image.timestamp_ns, world_from_body});
  }
  const PriorEstimate estimate = EstimateOrThrow(data);
  const PairErrors errors = ComputePairErrors(estimate, data.cams_from_world);
  EXPECT_EQ(estimate.summary.num_priors, 79);
  EXPECT_LT(errors.rotation_rms_deg, 0.05);
  EXPECT_LT(errors.translation_rms_m, 0.005);
}

TEST(SyntheticPriors, ImagesOutsideTheLogsAreCounted) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(11)));
  data.images.push_back(
      {1000, "late.png",
       data.images.back().timestamp_ns + timestamp_t{100'000'000'000}});
  const PriorEstimate estimate = EstimateOrThrow(data);
  EXPECT_EQ(estimate.summary.num_images, 81);
  EXPECT_EQ(estimate.summary.num_images_in_logs, 80);
  EXPECT_EQ(estimate.summary.num_priors, 79);
}

TEST(SyntheticPriors, NoOverlapIsAnError) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(12)));
  for (ImageStamp& image : data.images) {
    image.timestamp_ns += 1'000'000'000'000;
  }
  const StatusOr<PriorEstimate> estimate =
      EstimatePriors(data.images, data.logs, data.calibration, {}, {});
  ASSERT_FALSE(estimate.ok());
  EXPECT_NE(estimate.status().message().find("no image lies within"),
            std::string::npos);
}

TEST(SyntheticPriors, AGapInTheImuCostsItsPairsOnly) {
  Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(13)));
  data.calibration.has_wheel = false;
  data.logs.wheel.clear();
  const timestamp_t start = data.images[30].timestamp_ns + 10'000'000;
  const timestamp_t end = data.images[33].timestamp_ns - 10'000'000;
  std::vector<ImuSample> kept;
  for (const ImuSample& sample : data.logs.imu) {
    if (sample.timestamp_ns < start || sample.timestamp_ns > end) {
      kept.push_back(sample);
    }
  }
  data.logs.imu = kept;
  const PriorEstimate estimate = EstimateOrThrow(data);
  EXPECT_EQ(estimate.summary.num_priors, 76);
  EXPECT_EQ(estimate.inertial_motions.size(), 76);
  EXPECT_LT(ComputePairErrors(estimate, data.cams_from_world).rotation_rms_deg,
            0.05);
}

TEST(SyntheticPriors, SameInputSameResult) {
  const Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(14)));
  const PriorEstimate a = EstimateOrThrow(data), b = EstimateOrThrow(data);
  for (size_t i = 0; i < a.priors.size(); ++i) {
    EXPECT_EQ(a.priors[i].covariance, b.priors[i].covariance);
    EXPECT_EQ(a.priors[i].cam2_from_cam1.translation,
              b.priors[i].cam2_from_cam1.translation);
  }
}

TEST(PriorEstimationOptions, BadValuesAreNamed) {
  PriorEstimationOptions options;
  std::string error;
  EXPECT_TRUE(options.IsValid(&error));
  options.links.max_imu_gap_s = 0.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("max_imu_gap_s"), std::string::npos);
  EXPECT_THROW(EstimatePriors({}, {}, {}, {}, options), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
