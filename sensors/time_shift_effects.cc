// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/time_shift_effects.h"

#include <algorithm>

#include "core/so3.h"
#include "sensors/preintegration/imu_preintegration.h"

namespace adasfm {

// The mean of 20 ms, so that noise and quantisation of single samples hardly
// count.
std::optional<ImuMotion> MeasureImuMotion(const std::vector<ImuSample>& log,
                                          timestamp_t timestamp_ns,
                                          const OdometryState& state) {
  constexpr timestamp_t kHalfNs = 10'000'000;
  if (log.empty()) return std::nullopt;
  const timestamp_t start_ns =
      std::max(timestamp_ns - kHalfNs, log.front().timestamp_ns);
  const timestamp_t end_ns =
      std::min(timestamp_ns + kHalfNs, log.back().timestamp_ns);
  if (end_ns <= start_ns) return std::nullopt;
  const ImuPreintegration sum =
      PreintegrateImu(log, start_ns, end_ns, state.bias, ImuNoise());
  ImuMotion motion;
  motion.rate = LogSo3(sum.delta_rotation) / sum.dt_s;
  motion.specific_force = sum.delta_velocity / sum.dt_s;
  motion.velocity = state.velocity_in_imu;
  return motion;
}

// With T_k(c) the pose of camera k at its time + c in its frame at its time,
// the motion is T_2(c)^-1 P T_1(c).
void SetTimeShiftEffects(const ImuMotion& first, const ImuMotion& second,
                         const Rigid3d& cam_from_imu,
                         RelativePosePrior* prior) {
  const Eigen::Vector3d cam_in_imu = cam_from_imu.Inverse().translation;
  const auto rate = [&](const ImuMotion& motion) {
    return Eigen::Vector3d(cam_from_imu.rotation * motion.rate);
  };
  const auto velocity = [&](const ImuMotion& motion) {
    return Eigen::Vector3d(cam_from_imu.rotation *
                           (motion.velocity + motion.rate.cross(cam_in_imu)));
  };
  const Eigen::Quaterniond& rotation = prior->cam2_from_cam1.rotation;
  prior->rotation_by_time_shift = rotation * rate(first) - rate(second);
  if (!prior->HasTranslation()) return;
  prior->translation_by_time_shift =
      rotation * velocity(first) - velocity(second) +
      prior->cam2_from_cam1.translation.cross(rate(second));
}

// dv = integral of R_1^T R f, dp = integral of (t_2 - t) R_1^T R f.
void SetTimeShiftEffects(const ImuMotion& first, const ImuMotion& second,
                         const Rigid3d& cam_from_imu,
                         const RelativePosePrior& prior,
                         InertialMotion* motion) {
  const Eigen::Vector3d rate = cam_from_imu.rotation * first.rate;
  const Eigen::Vector3d force1 = cam_from_imu.rotation * first.specific_force;
  const Eigen::Vector3d force2 = cam_from_imu.rotation * second.specific_force;
  motion->velocity_by_time_shift =
      prior.cam2_from_cam1.rotation.conjugate() * force2 - force1 -
      rate.cross(motion->delta_velocity);
  motion->position_by_time_shift = motion->delta_velocity -
                                   motion->dt_s * force1 -
                                   rate.cross(motion->delta_position);
  motion->translation_by_time_shift = prior.translation_by_time_shift;
}

}  // namespace adasfm
