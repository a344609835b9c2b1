// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/sensor_logs.h"

#include <algorithm>
#include <cmath>

#include "synthetic/street_grid.h"

namespace adasfm {
namespace {

constexpr double kGravity = 9.81;
constexpr double kSlipCorrelationTime = 1.0;  // s
constexpr double kGnssJumpDuration = 5.0;     // s
const Eigen::Vector3d kGnssJump(12.0, 9.0, 0.0);

struct Slip {
  double begin_s, end_s, factor;
};

// Slip of a wheel on gravel, correlated in time.
class GravelSlip {
 public:
  GravelSlip(const SyntheticWorldOptions& options, uint64_t wheel)
      : sigma_(options.wheel_slip_sigma),
        keep_(std::exp(-1.0 / (kSyntheticWheelRateHz * kSlipCorrelationTime))),
        random_(MakeRandom(options.seed, 19, wheel)),
        slip_(random_.Gaussian(sigma_)) {}

  // Advances by one sample.
  double Next() {
    slip_ = keep_ * slip_ +
            random_.Gaussian(std::sqrt(1.0 - keep_ * keep_) * sigma_);
    return slip_;
  }

 private:
  double sigma_;
  double keep_;
  Random random_;
  double slip_;
};

// One slip in each of equally long stretches of the drive.
std::vector<Slip> DrawSlips(const SyntheticWorldOptions& options,
                            double first_image_s, double end_s) {
  Random random = MakeRandom(options.seed, 8);
  std::vector<Slip> slips;
  const double stretch =
      (end_s - first_image_s) / std::max(1, options.num_wheel_slips);
  for (int i = 0; i < options.num_wheel_slips; ++i) {
    const double duration = std::min(random.Uniform(0.5, 1.5), 0.5 * stretch);
    const double begin =
        first_image_s + i * stretch + random.Uniform(0.0, stretch - duration);
    slips.push_back({begin, begin + duration, random.Uniform(1.3, 1.8)});
  }
  return slips;
}

}  // namespace

void SimulateImu(const Drive& drive, double end_s, SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  Random bias_random = MakeRandom(options.seed, 6);
  world->true_gyro_bias = bias_random.GaussianVector(options.gyro_bias_sigma);
  world->true_accel_bias = bias_random.GaussianVector(options.accel_bias_sigma);
  Random random = MakeRandom(options.seed, 7);
  const ImuNoise& noise = options.imu_noise;
  const double dt = 1.0 / options.imu_rate_hz;
  const double root_dt = std::sqrt(dt);
  Eigen::Vector3d gyro_bias = world->true_gyro_bias;
  Eigen::Vector3d accel_bias = world->true_accel_bias;
  const int64_t num_samples =
      static_cast<int64_t>(std::ceil(end_s * options.imu_rate_hz)) + 1;
  for (int64_t i = 0; i < num_samples; ++i) {
    const timestamp_t time_ns = NsFromSeconds(i * dt);
    const DriveState state = drive.StateAt(SecondsFromNs(time_ns));
    ImuSample sample;
    sample.timestamp_ns = kWorldStartNs + time_ns;
    sample.angular_velocity =
        (1.0 + options.gyro_scale) * state.angular_velocity_in_imu + gyro_bias +
        random.GaussianVector(noise.gyroscope_noise_density / root_dt);
    sample.specific_force =
        state.world_from_imu.rotation.conjugate() *
            (state.acceleration_in_world +
             kGravity * Eigen::Vector3d::UnitZ()) +
        accel_bias +
        random.GaussianVector(noise.accelerometer_noise_density / root_dt);
    world->imu_samples.push_back(sample);
    gyro_bias += random.GaussianVector(noise.gyroscope_random_walk * root_dt);
    gyro_bias.z() += options.gyro_drift * dt;
    accel_bias +=
        random.GaussianVector(noise.accelerometer_random_walk * root_dt);
  }
}

void SimulateWheels(const Drive& drive, double first_image_s, double end_s,
                    SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  const std::vector<Slip> slips = DrawSlips(options, first_image_s, end_s);
  const timestamp_t shift_ns = NsFromSeconds(options.timeshift_cam_imu_s);
  for (const Slip& slip : slips) {
    const timestamp_t offset_ns = kWorldStartNs - shift_ns;
    world->wheel_slips.emplace_back(offset_ns + NsFromSeconds(slip.begin_s),
                                    offset_ns + NsFromSeconds(slip.end_s));
  }
  Random random = MakeRandom(options.seed, 9);
  GravelSlip left(options, 0);
  GravelSlip right(options, 1);
  const int64_t num_samples =
      static_cast<int64_t>(std::ceil(end_s * kSyntheticWheelRateHz)) + 1;
  for (int64_t i = 0; i < num_samples; ++i) {
    const timestamp_t time_ns = NsFromSeconds(i / kSyntheticWheelRateHz);
    const double time_s = SecondsFromNs(time_ns);
    const DriveState state = drive.StateAt(time_s);
    WheelSample sample;
    sample.timestamp_ns = kWorldStartNs + time_ns;
    const double left_factor = 1.0 + left.Next();
    const double right_factor = 1.0 + right.Next();
    if (state.wheel_speed != 0.0 || state.wheel_yaw_rate != 0.0) {
      double factor = 1.0 / options.wheel_scale;
      for (const Slip& slip : slips) {
        if (time_s >= slip.begin_s && time_s < slip.end_s)
          factor *= slip.factor;
      }
      const double half = 0.5 * world->track_width_m * state.wheel_yaw_rate;
      sample.first = factor * left_factor * (state.wheel_speed - half) +
                     random.Gaussian(options.wheel_speed_noise);
      sample.second = factor * right_factor * (state.wheel_speed + half) +
                      random.Gaussian(options.wheel_speed_noise);
    }
    world->wheel_samples.push_back(sample);
  }
}

void SimulateGnss(const Drive& drive, double end_s, SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  if (options.gnss_rate_hz <= 0.0) return;
  Random random = MakeRandom(options.seed, 20);
  // One jump in the middle of each of equally long stretches of the drive.
  const double first_s = drive.FirstImageTime();
  const double stretch_s =
      (end_s - first_s) / std::max(1, options.num_gnss_jumps);
  const auto is_in_jump = [&](double time_s) {
    if (options.num_gnss_jumps == 0 || time_s < first_s) return false;
    const double in_stretch = std::fmod(time_s - first_s, stretch_s);
    return std::abs(in_stretch - 0.5 * stretch_s) < 0.5 * kGnssJumpDuration;
  };
  for (int64_t i = 0; i / options.gnss_rate_hz <= end_s; ++i) {
    const timestamp_t time_ns = NsFromSeconds(i / options.gnss_rate_hz);
    const double time_s = SecondsFromNs(time_ns);
    SyntheticFix fix;
    fix.timestamp_ns = kWorldStartNs + time_ns;
    fix.position_in_world =
        drive.StateAt(time_s).world_from_imu * world->antenna_in_imu +
        random.GaussianVector(options.gnss_noise_m);
    if (is_in_jump(time_s)) fix.position_in_world += kGnssJump;
    world->gnss_fixes.push_back(fix);
  }
}

}  // namespace adasfm
