// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

constexpr int kNumSeeds = 24;

// Errors of the machine and of its stated calibration.
struct Mismatch {
  std::string name;
  // The machine's yaw rate rings while its wheels stand: amplitude (rad/s) and
  // frequency (Hz), at any phase.
  double ringing = 0.0;
  double frequency_hz = 1.0;
  // Factor per second by which the amplitude grows, up to `ringing` at the end
  // of the standstill.
  double growth = 1.0;
  // Left wheel longer, right wheel shorter by half of this.
  double wheel_difference = 0.0;
  // Error of the speed that both wheels share, of correlation time 1 s, m/s.
  double slow_wheel_error = 0.0;
  // Stated noise figures of IMU and wheels over the true ones.
  double noise_factor = 1.0;
  // Delay of the wheels' readings with respect to their stamps, s.
  double wheel_delay_s = 0.0;
};

// Adds the yaw rate of a machine that rings while its wheels stand.
void AddRinging(const Mismatch& mismatch, double phase, double standstill_s,
                Dataset* data) {
  const timestamp_t start_ns = data->logs.imu.front().timestamp_ns;
  const double omega = 2.0 * kPi * mismatch.frequency_hz;
  for (ImuSample& sample : data->logs.imu) {
    const double time_s = SecondsFromNs(sample.timestamp_ns - start_ns);
    if (time_s >= standstill_s) return;
    sample.angular_velocity.z() +=
        mismatch.ringing * std::pow(mismatch.growth, time_s - standstill_s) *
        std::sin(omega * time_s + phase);
  }
}

Dataset SpoiltDataset(const SyntheticWorld& world, const Mismatch& mismatch,
                      uint64_t seed) {
  Dataset data = ToDataset(world);
  Random random(seed);
  AddRinging(mismatch, random.Uniform(0.0, 2.0 * kPi),
             world.options.standstill_s, &data);
  const double keep = std::exp(-1.0 / kSyntheticWheelRateHz);
  double slow_error = random.Gaussian(mismatch.slow_wheel_error);
  for (WheelSample& sample : data.logs.wheel) {
    sample.timestamp_ns += std::llround(1e9 * mismatch.wheel_delay_s);
    slow_error =
        keep * slow_error +
        random.Gaussian(mismatch.slow_wheel_error * std::sqrt(1 - keep * keep));
    if (sample.first == 0.0 && sample.second == 0.0) continue;
    sample.first *= 1.0 + 0.5 * mismatch.wheel_difference;
    sample.second *= 1.0 - 0.5 * mismatch.wheel_difference;
    sample.first += slow_error;
    sample.second += slow_error;
  }
  SensorCalibration& calibration = data.calibration;
  calibration.imu_noise.gyroscope_noise_density *= mismatch.noise_factor;
  calibration.imu_noise.accelerometer_noise_density *= mismatch.noise_factor;
  calibration.wheel_speed_noise *= mismatch.noise_factor;
  // The biases of the worlds hardly walk; the stated random walks are small.
  calibration.imu_noise.gyroscope_random_walk = 2e-5;
  calibration.imu_noise.accelerometer_random_walk = 2e-4;
  return data;
}

class Honesty : public testing::TestWithParam<Mismatch> {};

// Gyroscope bias (all axes), wheel scale and wheel delay are within three of
// their sigmas of the truth in 95 % of seeds. Then at most 4 of 24 seeds are
// not, with a probability of 0.99.
TEST_P(Honesty, SharedErrorsAreWithinThreeSigmas) {
  constexpr int kMaxNumFailures = 4;
  const Mismatch& mismatch = GetParam();
  int num_bias_failures = 0, num_scale_failures = 0, num_delay_failures = 0;
  double bias_chi2 = 0.0, scale_chi2 = 0.0, bias_sigma = 0.0;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 120);
    options.wheel_scale = seed % 2 == 0 ? 1.008 : 0.994;
    options.imu_noise.gyroscope_random_walk = 1e-7;
    options.imu_noise.accelerometer_random_walk = 1e-6;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Dataset data = SpoiltDataset(world, mismatch, seed);
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration, {}, {});
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    const SensorSummary& summary = estimate->summary;
    EXPECT_TRUE(summary.warnings.empty()) << summary.warnings.front();
    const Eigen::Array3d sigma =
        summary.gyroscope_bias_covariance.diagonal().cwiseSqrt();
    const Eigen::Array3d error =
        (summary.gyroscope_bias - world.true_gyro_bias).array() / sigma;
    const double scale_error =
        (summary.wheel_scale - options.wheel_scale) / summary.wheel_scale_sigma;
    num_bias_failures += error.abs().maxCoeff() > 3.0 ? 1 : 0;
    num_scale_failures += std::abs(scale_error) > 3.0 ? 1 : 0;
    const double delay_error = summary.wheel_delay_s - mismatch.wheel_delay_s;
    num_delay_failures +=
        std::abs(delay_error) > 3.0 * summary.wheel_delay_sigma_s ? 1 : 0;
    bias_chi2 += error.square().mean() / kNumSeeds;
    scale_chi2 += scale_error * scale_error / kNumSeeds;
    bias_sigma += sigma.z() / kNumSeeds;
  }
  std::printf(
      "%s: bias %d failures, chi2 %.2f, sigma of yaw %.6f; scale %d, %.2f; "
      "delay %d\n",
      mismatch.name.c_str(), num_bias_failures, bias_chi2, bias_sigma,
      num_scale_failures, scale_chi2, num_delay_failures);
  EXPECT_LE(num_bias_failures, kMaxNumFailures);
  EXPECT_LE(num_scale_failures, kMaxNumFailures);
  EXPECT_LE(num_delay_failures, kMaxNumFailures);
  // The sigmas must be small, too: three seconds at rest determine a bias.
  EXPECT_LT(bias_sigma, 3.0 * std::max(1.0, mismatch.noise_factor) * 3e-4);
}

INSTANTIATE_TEST_SUITE_P(
    Worlds, Honesty,
    testing::Values(
        Mismatch{"AsStated"}, Mismatch{"SlowRinging", 2e-3, 0.4},
        Mismatch{"Ringing", 2e-3, 1.0}, Mismatch{"Starting", 0.13, 1.0, 14.0},
        Mismatch{"UnequalWheels", 0.0, 1.0, 1.0, 0.004},
        Mismatch{"SlowWheels", 0.0, 1.0, 1.0, 0.004, 0.05},
        Mismatch{"NoiseTooSmall", 5e-4, 1.0, 1.0, 0.004, 0.0, 1.0 / 3},
        Mismatch{"NoiseTooLarge", 5e-4, 1.0, 1.0, 0.004, 0.0, 3.0},
        Mismatch{"LateWheels", 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.025}),
    [](const auto& mismatch) { return mismatch.param.name; });

// Priors of a log that comes late are those of the log on time, to a third of
// their sigmas: the delay itself is known to 1.2 ms.
TEST(WheelDelay, IsTakenOut) {
  for (int seed = 1; seed <= 5; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 120);
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const auto estimate = [&](double delay_s) {
      Mismatch mismatch;
      mismatch.wheel_delay_s = delay_s;
      const Dataset data = SpoiltDataset(world, mismatch, seed);
      StatusOr<PriorEstimate> estimate =
          EstimatePriors(data.images, data.logs, data.calibration, {}, {});
      EXPECT_TRUE(estimate.ok()) << estimate.status().message();
      return std::move(estimate).value();
    };
    const PriorEstimate on_time = estimate(0.0);
    const PriorEstimate late = estimate(0.04);
    ASSERT_EQ(late.priors.size(), on_time.priors.size());
    double chi2 = 0.0;
    for (size_t k = 0; k < late.priors.size(); ++k) {
      const RelativePosePrior& prior = on_time.priors[k];
      const Eigen::Vector3d difference =
          late.priors[k].cam2_from_cam1.translation -
          prior.cam2_from_cam1.translation;
      chi2 += difference.dot(
          prior.covariance.bottomRightCorner<3, 3>().inverse() * difference);
    }
    EXPECT_LT(chi2, 0.1 * 3.0 * late.priors.size()) << "seed " << seed;
  }
}

// Relative errors of the priors' lengths, less their mean, which is the scale.
std::vector<double> LengthErrors(const Dataset& data,
                                 const PriorEstimate& estimate) {
  std::vector<double> errors;
  double sum = 0.0;
  for (const RelativePosePrior& prior : estimate.priors) {
    const double length =
        ComputeCam2FromCam1(data.cams_from_world.at(prior.image_id1),
                            data.cams_from_world.at(prior.image_id2))
            .translation.norm();
    if (length < 0.3) continue;
    errors.push_back(prior.cam2_from_cam1.translation.norm() / length - 1.0);
    sum += errors.back();
  }
  for (double& error : errors) error -= sum / errors.size();
  return errors;
}

// Wheels that slip by 3 % for a second at a time, and wheels that do not.
TEST(LengthHonesty, LengthsErrTogetherOnGravelAsStated) {
  double gravel_chi2 = 0.0;
  constexpr int kNumWorlds = 8;
  for (int seed = 1; seed <= kNumWorlds; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 150);
    const Dataset plain = ToDataset(BuildSyntheticWorld(options));
    options.wheel_slip_sigma = 0.03;
    const Dataset gravel = ToDataset(BuildSyntheticWorld(options));
    const auto estimate = [](const Dataset& data) {
      return EstimatePriors(data.images, data.logs, data.calibration, {}, {});
    };
    const StatusOr<PriorEstimate> on_plain = estimate(plain);
    ASSERT_TRUE(on_plain.ok()) << on_plain.status().message();
    EXPECT_EQ(on_plain->summary.length_drift_ratio, 0.0) << "seed " << seed;
    const StatusOr<PriorEstimate> on_gravel = estimate(gravel);
    ASSERT_TRUE(on_gravel.ok()) << on_gravel.status().message();
    const double sigma = on_gravel->summary.length_drift_ratio;
    ASSERT_GT(sigma, 0.0) << "seed " << seed;
    const std::vector<double> errors = LengthErrors(gravel, *on_gravel);
    double product = 0.0, square = 0.0;
    for (size_t k = 1; k < errors.size(); ++k) {
      product += errors[k - 1] * errors[k];
      square += errors[k] * errors[k];
    }
    EXPECT_GT(product, 0.9 * square) << "seed " << seed;
    gravel_chi2 += square / errors.size() / (sigma * sigma) / kNumWorlds;
  }
  std::printf("lengths on gravel: chi2 %.2f\n", gravel_chi2);
  // Some five independent errors a world, 40 in all: 1 +- 0.22, at 4 sigmas.
  EXPECT_LT(gravel_chi2, 1.9);
  EXPECT_GT(gravel_chi2, 0.1);
}

}  // namespace
}  // namespace adasfm
