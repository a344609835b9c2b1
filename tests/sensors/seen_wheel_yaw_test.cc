// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/seen_wheel_yaw.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

Dataset WheelsAlone(const SyntheticWorld& world) {
  Dataset data = ToDataset(world);
  data.calibration.has_imu = false;
  data.logs.imu.clear();
  return data;
}

double Duration(const Dataset& data) {
  return SecondsFromNs(data.images.back().timestamp_ns -
                       data.images[0].timestamp_ns);
}

// The absolute sum of the priors' errors about the vertical, rad.
double SummedYawError(const PriorEstimate& estimate, const Dataset& data) {
  double sum = 0.0;
  for (const RelativePosePrior& prior : estimate.priors) {
    const Rigid3d truth = data.cams_from_world.at(prior.image_id2) *
                          data.cams_from_world.at(prior.image_id1).Inverse();
    sum +=
        LogSo3(prior.cam2_from_cam1.rotation * truth.rotation.conjugate()).y();
  }
  return std::abs(sum);
}

// The expected sum: the noise of two-view rotations in the estimate of one
// error that all links share, and the noise of the wheels.
double SummedYawSigma(double vision_sigma_rad, const SyntheticWorld& world,
                      const Dataset& data) {
  const double of_wheels = std::sqrt(2.0) * world.options.wheel_speed_noise /
                           world.track_width_m *
                           std::sqrt(Duration(data) / kSyntheticWheelRateHz);
  return std::hypot(
      vision_sigma_rad * std::sqrt(static_cast<double>(data.images.size())),
      of_wheels);
}

// The right wheel turns too fast for a second from this image on.
void Slip(size_t image, double ratio, Dataset* data) {
  const timestamp_t begin_ns = data->images[image].timestamp_ns;
  for (WheelSample& sample : data->logs.wheel) {
    if (sample.timestamp_ns >= begin_ns &&
        sample.timestamp_ns < begin_ns + 1'000'000'000) {
      sample.second *= 1.0 + ratio;
    }
  }
}

// One slipping wheel adds tens of degrees to the yaw of the log: faster than
// any tyre allows or, with a smaller slip, observable only by cameras if there
// is no IMU.
TEST(SeenWheelYaw, WheelsThatSlipWithoutAnImuAreFound) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed));
    Dataset data = WheelsAlone(world);
    const std::vector<VisualRotation> vision =
        SimulateVision(world, seed, {5e-3, 1});
    const auto estimate = [&](double slip,
                              const std::vector<VisualRotation>& rotations) {
      Dataset slipping = data;
      Slip(40, slip, &slipping);
      return EstimatePriors(data.images, slipping.logs, data.calibration,
                            rotations, {})
          .value();
    };
    const auto chi2 = [&](const PriorEstimate& estimate) {
      return ComputePairErrors(estimate, data.cams_from_world).chi2;
    };
    const PriorEstimate healthy = estimate(0.0, vision);
    EXPECT_TRUE(healthy.summary.warnings.empty());
    EXPECT_LT(chi2(healthy), 1.25) << "seed " << seed;
    // A slip that exceeds what tyres allow.
    const PriorEstimate skid = estimate(0.5, {});
    EXPECT_EQ(skid.summary.warnings.size(), 1);
    EXPECT_LT(chi2(skid), 1.25) << "seed " << seed;
    const PriorEstimate seen_skid = estimate(0.5, vision);
    EXPECT_EQ(seen_skid.summary.warnings.size(), 1);
    EXPECT_LT(chi2(seen_skid), 1.25) << "seed " << seed;
    // A slip that only cameras observe, at 8 m/s for a second.
    const double slip_rad = 0.15 * 8.0 / world.track_width_m;
    EXPECT_GT(SummedYawError(estimate(0.15, {}), data), 0.5 * slip_rad)
        << "seed " << seed;
    const PriorEstimate slip = estimate(0.15, vision);
    EXPECT_EQ(slip.summary.warnings.size(), 1);
    EXPECT_LT(chi2(slip), 1.25) << "seed " << seed;
    EXPECT_LT(slip.priors.size(), healthy.priors.size());
    // Visual rotations that agree for three images replace those of the wheels.
    const PriorEstimate turned =
        estimate(0.15, SimulateVision(world, seed, {5e-3, 2}));
    EXPECT_EQ(turned.priors.size(), healthy.priors.size()) << "seed " << seed;
    EXPECT_LT(chi2(turned), 1.25) << "seed " << seed;
    EXPECT_LT(SummedYawError(turned, data),
              3.0 * SummedYawSigma(5e-3, world, data))
        << "seed " << seed;
    // A wrong rotation costs one prior and nothing else.
    for (const double ratio : {0.15, 0.5}) {
      EXPECT_LT(
          chi2(estimate(ratio, SimulateVision(world, seed, {5e-3, 1, 0.05}))),
          1.25)
          << "seed " << seed;
    }
  }
}

// Wheels that differ by 1 % add 0.009 rad of yaw a metre to all links.
TEST(SeenWheelYaw, CamerasSeeWhatWheelsTurnAlike) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 200));
    Dataset data = WheelsAlone(world);
    for (WheelSample& sample : data.logs.wheel) sample.second *= 1.01;
    const PriorEstimate alone =
        EstimatePriors(data.images, data.logs, data.calibration, {}, {})
            .value();
    const PriorEstimate seen =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed, {3e-3, 1, 0.02}), {})
            .value();
    const auto sigma_rad = [&](const PriorEstimate& estimate) {
      return Duration(data) *
             std::sqrt(estimate.summary.gyroscope_bias_covariance.trace());
    };
    EXPECT_GT(SummedYawError(alone, data), 0.5) << "seed " << seed;
    EXPECT_LT(SummedYawError(seen, data),
              3.0 * SummedYawSigma(3e-3, world, data))
        << "seed " << seed;
    // The stated shared errors agree with both sums.
    for (const PriorEstimate* estimate : {&alone, &seen}) {
      EXPECT_LT(SummedYawError(*estimate, data),
                3.0 * std::hypot(sigma_rad(*estimate),
                                 SummedYawSigma(0.0, world, data)))
          << "seed " << seed;
    }
  }
}

// Many slips to one side must not be taken for a difference of the wheels.
TEST(SeenWheelYaw, ManySlipsAlikeAreSlips) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 200));
    Dataset data = WheelsAlone(world);
    for (const size_t image : {20, 50, 80, 110, 140, 170}) {
      Slip(image, 0.15, &data);
    }
    const PriorEstimate estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed, {3e-3, 2}), {})
            .value();
    EXPECT_EQ(estimate.priors.size(), data.images.size() - 1);
    EXPECT_LT(ComputePairErrors(estimate, data.cams_from_world).chi2, 1.25)
        << "seed " << seed;
    EXPECT_LT(SummedYawError(estimate, data),
              3.0 * SummedYawSigma(3e-3, world, data))
        << "seed " << seed;
  }
}

// Wheels that slip where cameras observe it are assumed to slip elsewhere, too.
// Wheels that never slip keep their sigmas there.
TEST(SeenWheelYaw, SlipsThatNoCameraSeesAreAllowedFor) {
  constexpr size_t kFirst = 130, kLast = 150;  // no pairs between
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 200));
    Dataset data = WheelsAlone(world);
    std::vector<VisualRotation> vision;
    for (const VisualRotation& rotation :
         SimulateVision(world, seed, {3e-3, 2})) {
      const auto is_seen = [&](image_t image_id) {
        return image_id <= data.images[kFirst].image_id ||
               image_id >= data.images[kLast].image_id;
      };
      if (is_seen(rotation.image_id1) && is_seen(rotation.image_id2)) {
        vision.push_back(rotation);
      }
    }
    // Mean squared errors in sigmas, and mean sigmas, of unobserved yaws.
    double chi2 = 0.0, sigma_rad = 0.0;
    const auto measure = [&] {
      const PriorEstimate estimate =
          EstimatePriors(data.images, data.logs, data.calibration, vision, {})
              .value();
      chi2 = sigma_rad = 0.0;
      for (const RelativePosePrior& prior : estimate.priors) {
        if (prior.image_id1 < data.images[kFirst].image_id ||
            prior.image_id2 > data.images[kLast].image_id) {
          continue;
        }
        const Rigid3d truth =
            data.cams_from_world.at(prior.image_id2) *
            data.cams_from_world.at(prior.image_id1).Inverse();
        const double error =
            LogSo3(prior.cam2_from_cam1.rotation * truth.rotation.conjugate())
                .y();
        chi2 += error * error / prior.covariance(1, 1) / (kLast - kFirst);
        sigma_rad += std::sqrt(prior.covariance(1, 1)) / (kLast - kFirst);
      }
    };
    measure();
    const double sigma_without_rad = sigma_rad;
    EXPECT_LT(chi2, 2.0) << "seed " << seed;
    Slip(140, 0.15, &data);
    measure();
    EXPECT_NEAR(sigma_rad, sigma_without_rad, 0.1 * sigma_without_rad);
    EXPECT_GT(chi2, 20.0) << "seed " << seed;
    for (const size_t image : {20, 50, 80, 170}) Slip(image, 0.15, &data);
    measure();
    EXPECT_GT(sigma_rad, 5.0 * sigma_without_rad) << "seed " << seed;
    // Slips take a fourth of the unobserved time, a tenth of the observed.
    EXPECT_LT(chi2, 2.0 * 2.5) << "seed " << seed;
  }
}

// An image whose pairs share one error closes every triple. Wheels that agree
// with the visual rotation from the image before to the image after did not
// slip.
TEST(SeenWheelYaw, AnImageWithWrongPairsIsNoSlip) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed));
    const Dataset data = WheelsAlone(world);
    std::vector<VisualRotation> vision = SimulateVision(world, seed, {5e-3, 2});
    const image_t wrong = data.images[40].image_id;
    const Eigen::Quaterniond error = ExpSo3(Eigen::Vector3d(0.0, 0.1, 0.0));
    for (VisualRotation& rotation : vision) {
      Eigen::Quaterniond& cam2_from_cam1 = rotation.cam2_from_cam1;
      if (rotation.image_id1 == wrong) cam2_from_cam1 *= error.conjugate();
      if (rotation.image_id2 == wrong) cam2_from_cam1 = error * cam2_from_cam1;
    }
    const PriorEstimate estimate =
        EstimatePriors(data.images, data.logs, data.calibration, vision, {})
            .value();
    EXPECT_TRUE(estimate.summary.warnings.empty()) << "seed " << seed;
    EXPECT_EQ(estimate.priors.size(), data.images.size() - 1);
    EXPECT_LT(ComputePairErrors(estimate, data.cams_from_world).chi2, 1.25)
        << "seed " << seed;
  }
}

}  // namespace
}  // namespace adasfm
