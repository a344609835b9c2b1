// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/preintegration/imu_preintegration.h"

#include <stdexcept>

#include "core/so3.h"

namespace adasfm {
namespace {

// Rotation and acceleration over a step of constant rate and force, and their
// derivatives by the attitude at its start.
struct ImuStep {
  ImuStep(const Eigen::Vector3d& angular_velocity,
          const Eigen::Vector3d& specific_force, double step_s,
          const Eigen::Quaterniond& delta_rotation)
      : dt(step_s), half_dt2(0.5 * step_s * step_s) {
    const Eigen::Vector3d turn = angular_velocity * dt;
    rotation = ExpSo3(turn);
    right_jacobian = RightJacobianSo3(turn);
    // The force rotates with the body: its mean over the step, in the frame at
    // the start of the interval, is close to its value in the middle.
    middle = (delta_rotation * ExpSo3(0.5 * turn)).toRotationMatrix();
    acceleration = middle * specific_force;
    // d (middle f) = -middle [f]x (dtheta at the middle).
    force_by_middle = -middle * Hat(specific_force);
    half_transposed = ExpSo3(0.5 * turn).toRotationMatrix().transpose();
    transposed = rotation.toRotationMatrix().transpose();
  }

  double dt;
  double half_dt2;
  Eigen::Quaterniond rotation;
  Eigen::Matrix3d transposed, half_transposed, right_jacobian, middle;
  Eigen::Vector3d acceleration;
  Eigen::Matrix3d force_by_middle;
};

// Position first, rotation last: each update uses the old values.
void IntegrateBiasJacobians(const ImuStep& step, ImuPreintegration* sum) {
  const Eigen::Matrix3d middle_by_gyroscope =
      step.half_transposed * sum->rotation_by_gyroscope -
      0.5 * step.dt * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d force_by_gyroscope =
      step.force_by_middle * middle_by_gyroscope;
  sum->position_by_gyroscope +=
      step.dt * sum->velocity_by_gyroscope + step.half_dt2 * force_by_gyroscope;
  sum->position_by_accelerometer +=
      step.dt * sum->velocity_by_accelerometer - step.half_dt2 * step.middle;
  sum->velocity_by_gyroscope += step.dt * force_by_gyroscope;
  sum->velocity_by_accelerometer -= step.dt * step.middle;
  sum->rotation_by_gyroscope = step.transposed * sum->rotation_by_gyroscope -
                               step.dt * step.right_jacobian;
}

// Forster 2015, eq. 63.
void IntegrateCovariance(const ImuStep& step, const ImuNoise& noise,
                         ImuPreintegration* sum) {
  const double dt = step.dt;
  const Eigen::Matrix3d force_by_rotation =
      step.force_by_middle * step.half_transposed;
  Eigen::Matrix<double, 9, 9> transition =
      Eigen::Matrix<double, 9, 9>::Identity();
  transition.block<3, 3>(0, 0) = step.transposed;
  transition.block<3, 3>(3, 0) = dt * force_by_rotation;
  transition.block<3, 3>(6, 0) = step.half_dt2 * force_by_rotation;
  transition.block<3, 3>(6, 3) = dt * Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 9, 6> input = Eigen::Matrix<double, 9, 6>::Zero();
  input.block<3, 3>(0, 0) = dt * step.right_jacobian;
  input.block<3, 3>(3, 0) = step.half_dt2 * step.force_by_middle;
  input.block<3, 3>(3, 3) = dt * step.middle;
  input.block<3, 3>(6, 3) = step.half_dt2 * step.middle;
  Eigen::Matrix<double, 6, 1> variance;
  variance.head<3>().setConstant(noise.gyroscope_noise_density *
                                 noise.gyroscope_noise_density / dt);
  variance.tail<3>().setConstant(noise.accelerometer_noise_density *
                                 noise.accelerometer_noise_density / dt);
  sum->covariance = transition * sum->covariance * transition.transpose() +
                    input * variance.asDiagonal() * input.transpose();

  // Noise varies within the step, too: the independent share of the position,
  // without which velocity and position of one step would be perfectly
  // correlated.
  sum->covariance.bottomRightCorner<3, 3>().diagonal().array() +=
      noise.accelerometer_noise_density * noise.accelerometer_noise_density *
      dt * dt * dt / 12.0;
}

// Appends one step of constant angular velocity and specific force. Noise is
// white with the densities in noise: a step's mean has the variance
// density^2 / dt.
void IntegrateStep(const Eigen::Vector3d& angular_velocity,
                   const Eigen::Vector3d& specific_force, double dt,
                   const ImuNoise& noise, ImuPreintegration* sum) {
  const ImuStep step(angular_velocity, specific_force, dt, sum->delta_rotation);
  IntegrateBiasJacobians(step, sum);
  IntegrateCovariance(step, noise, sum);
  sum->delta_position +=
      dt * sum->delta_velocity + step.half_dt2 * step.acceleration;
  sum->delta_velocity += dt * step.acceleration;
  sum->delta_rotation = (sum->delta_rotation * step.rotation).normalized();
  sum->dt_s += dt;
}

}  // namespace

Eigen::Quaterniond ImuPreintegration::CorrectedRotation(
    const ImuBias& new_bias) const {
  const Eigen::Vector3d change = new_bias.gyroscope - bias.gyroscope;
  return delta_rotation * ExpSo3(rotation_by_gyroscope * change);
}

Eigen::Vector3d ImuPreintegration::CorrectedVelocity(
    const ImuBias& new_bias) const {
  return delta_velocity +
         velocity_by_gyroscope * (new_bias.gyroscope - bias.gyroscope) +
         velocity_by_accelerometer *
             (new_bias.accelerometer - bias.accelerometer);
}

Eigen::Vector3d ImuPreintegration::CorrectedPosition(
    const ImuBias& new_bias) const {
  return delta_position +
         position_by_gyroscope * (new_bias.gyroscope - bias.gyroscope) +
         position_by_accelerometer *
             (new_bias.accelerometer - bias.accelerometer);
}

ImuSample InterpolateImu(const std::vector<ImuSample>& samples,
                         timestamp_t timestamp_ns) {
  if (samples.empty() || timestamp_ns < samples.front().timestamp_ns ||
      timestamp_ns > samples.back().timestamp_ns) {
    throw std::invalid_argument("InterpolateImu: time outside the log");
  }
  const size_t next = IndexAfter(samples, timestamp_ns);
  if (next == samples.size()) return samples.back();
  const ImuSample& a = samples[next - 1];
  const ImuSample& b = samples[next];
  const double ratio = static_cast<double>(timestamp_ns - a.timestamp_ns) /
                       (b.timestamp_ns - a.timestamp_ns);
  ImuSample sample;
  sample.timestamp_ns = timestamp_ns;
  sample.angular_velocity =
      a.angular_velocity + ratio * (b.angular_velocity - a.angular_velocity);
  sample.specific_force =
      a.specific_force + ratio * (b.specific_force - a.specific_force);
  return sample;
}

ImuPreintegration PreintegrateImu(const std::vector<ImuSample>& samples,
                                  timestamp_t start_ns, timestamp_t end_ns,
                                  const ImuBias& bias, const ImuNoise& noise,
                                  std::vector<RotationAtTime>* profile) {
  if (end_ns < start_ns) {
    throw std::invalid_argument("PreintegrateImu: the end is before the start");
  }
  ImuPreintegration sum;
  sum.bias = bias;
  if (profile != nullptr) *profile = {{start_ns, sum.delta_rotation}};
  ImuSample last = InterpolateImu(samples, start_ns);
  const ImuSample end = InterpolateImu(samples, end_ns);
  for (size_t i = IndexAfter(samples, start_ns); last.timestamp_ns < end_ns;
       ++i) {
    const ImuSample& next = samples[i].timestamp_ns < end_ns ? samples[i] : end;
    const double dt = SecondsFromNs(next.timestamp_ns - last.timestamp_ns);
    IntegrateStep(
        0.5 * (last.angular_velocity + next.angular_velocity) - bias.gyroscope,
        0.5 * (last.specific_force + next.specific_force) - bias.accelerometer,
        dt, noise, &sum);
    last = next;
    if (profile != nullptr) {
      profile->push_back({last.timestamp_ns, sum.delta_rotation});
    }
  }
  return sum;
}

}  // namespace adasfm
