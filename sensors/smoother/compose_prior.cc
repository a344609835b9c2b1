// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/compose_prior.h"

#include <limits>

#include "core/so3.h"

namespace adasfm {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

OdometryMotion ComposeMotions(const OdometryFusionProblem& problem,
                              const OdometryFusionResult& fused, size_t first,
                              size_t last) {
  const auto is_at_rest = [&problem](size_t k) {
    return problem.links[k].standstill == StandstillKind::kAtRest;
  };
  int num_links = 0;
  Rigid3d body2_from_body1;
  Matrix6 covariance = Matrix6::Zero();
  for (size_t k = first; k < last; ++k) {
    const OdometryMotion& motion = fused.motions[k];
    num_links += k == first || !is_at_rest(k - 1) || !is_at_rest(k);
    // Expresses earlier errors in the frame at this link's end.
    Matrix6 carry = Matrix6::Identity();
    const Eigen::Matrix3d rotation =
        motion.body2_from_body1.rotation.toRotationMatrix();
    carry.topLeftCorner<3, 3>() = rotation;
    carry.bottomRightCorner<3, 3>() = rotation;
    Matrix6 own = Matrix6::Identity();
    own.bottomLeftCorner<3, 3>() =
        -Hat(rotation * body2_from_body1.translation);
    covariance = carry * covariance * carry.transpose() +
                 own * motion.covariance * own.transpose();
    body2_from_body1 = motion.body2_from_body1 * body2_from_body1;
  }
  covariance *= static_cast<double>(num_links);
  OdometryMotion motion;
  motion.body2_from_body1 = body2_from_body1;
  motion.covariance = covariance;
  return motion;
}

// From the body's frame to the camera's.
void SetMotion(const OdometryMotion& motion, const Rigid3d& cam_from_imu,
               RelativePosePrior* prior) {
  const Rigid3d imu_from_cam = cam_from_imu.Inverse();
  prior->cam2_from_cam1 = cam_from_imu * motion.body2_from_body1 * imu_from_cam;
  const Eigen::Matrix3d rotation = cam_from_imu.rotation.toRotationMatrix();
  Matrix6 map = Matrix6::Zero();
  map.topLeftCorner<3, 3>() = rotation;
  map.bottomRightCorner<3, 3>() = rotation;
  map.bottomLeftCorner<3, 3>() =
      -rotation *
      Hat(motion.body2_from_body1.rotation * imu_from_cam.translation);
  prior->covariance = map * motion.covariance * map.transpose();
}

// What is not observed gets infinite variance.
void Forget(int begin, RelativePosePrior* prior) {
  prior->covariance.middleRows<3>(begin).setZero();
  prior->covariance.middleCols<3>(begin).setZero();
  prior->covariance.diagonal().segment<3>(begin).setConstant(
      std::numeric_limits<double>::infinity());
}

}  // namespace

std::optional<double> SecondsBesideParking(const OdometryFusionProblem& problem,
                                           size_t first, size_t last) {
  double moving_s = 0.0;
  bool is_parked = false;
  for (size_t k = first; k < last; ++k) {
    const OdometryLink& link = problem.links[k];
    is_parked |= link.is_parked;
    if (link.standstill != StandstillKind::kAtRest) moving_s += link.dt_s;
  }
  if (!is_parked) return std::nullopt;
  return moving_s;
}

RelativePosePrior ComposePrior(const OdometryFusionProblem& problem,
                               const OdometryFusionResult& fused, size_t first,
                               size_t last, const Rigid3d& cam_from_imu) {
  RelativePosePrior prior;
  SetMotion(ComposeMotions(problem, fused, first, last), cam_from_imu, &prior);
  bool has_imu = true, has_wheel = true, has_yaw = true, is_slipping = false;
  for (size_t k = first; k < last; ++k) {
    const OdometryLink& link = problem.links[k];
    has_imu &= link.has_imu || link.is_parked;
    has_wheel &= link.has_wheel;
    has_yaw &=
        link.has_vision || link.is_parked ||
        (link.has_wheel && (link.has_wheel_yaw || link.wheel.has_rotation));
    is_slipping |= fused.motions[k].wheel_weight < kSlipWeight;
  }
  const bool has_rotation = has_imu || has_yaw;
  if (has_rotation) prior.flags |= kPriorRotation;
  if (has_rotation && has_wheel) prior.flags |= kPriorDirection;
  if (has_wheel) prior.flags |= kPriorLength;
  if (is_slipping && has_wheel) prior.flags |= kPriorWheelSlip;
  if (!has_rotation) Forget(0, &prior);
  if (!has_wheel) Forget(3, &prior);
  return prior;
}

}  // namespace adasfm
