// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/compose_wheel_translation.h"

#include "core/so3.h"
#include "sensors/smoother/chain_state.h"
#include "sensors/smoother/odometry_factors.h"
#include "sensors/smoother/wheel_equation.h"

namespace adasfm {
namespace {

// From the body's position at a link's start to that at its end, in the body's
// axes at the start.
using Step = MeasuredTranslation;

ChainGlobals GlobalsOf(const OdometryFusionResult& fused) {
  ChainGlobals globals;
  globals.values[ChainGlobals::kLoggedLength] = 1.0 / fused.wheel_scale;
  globals.values.segment<2>(ChainGlobals::kDrivingYaw) =
      fused.driving_direction;
  globals.values[ChainGlobals::kWheelDelay] = fused.wheel_delay_s;
  return globals;
}

Step StepByWheels(const OdometryFusionProblem& problem,
                  const OdometryFusionResult& fused,
                  const ChainGlobals& globals, size_t k) {
  const OdometryLink& link = problem.links[k];
  const WheelMotion& wheel = link.wheel;
  const Eigen::Vector3d& lever = problem.imu_from_wheel.translation;
  const Eigen::Quaterniond first_from_second =
      fused.motions[k].body2_from_body1.rotation.conjugate();
  const Eigen::Vector3d excess =
      LogSo3(wheel.profile_rotation.conjugate() * first_from_second);
  const Eigen::Matrix3d first_from_wheel =
      StartFromMiddleWheel(wheel, problem.imu_from_wheel.rotation);
  Eigen::Vector3d logged =
      DisplacementMap(wheel, excess) *
      globals.Forward(problem.imu_from_wheel.rotation, nullptr);
  if (link.has_imu) {
    logged += globals.values[ChainGlobals::kWheelDelay] *
              WheelSpeedChange(link, problem.imu_from_wheel, fused.states[k],
                               fused.states[k + 1]) *
              first_from_wheel.col(0);
  }
  Step step;
  step.translation =
      fused.wheel_scale * logged + lever - first_from_second * lever;
  Eigen::Matrix3d in_wheel =
      first_from_wheel.transpose() * wheel.covariance * first_from_wheel;
  in_wheel(0, 0) *= problem.wheel_persistence;
  step.covariance = fused.wheel_scale * fused.wheel_scale /
                    fused.motions[k].wheel_weight * first_from_wheel *
                    in_wheel * first_from_wheel.transpose();
  return step;
}

Step StepAtRest(const OdometryLink& link) {
  const double sigma = RestStepSigma(link);
  Step step;
  step.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  return step;
}

}  // namespace

std::optional<MeasuredTranslation> ComposeWheelTranslation(
    const OdometryFusionProblem& problem, const OdometryFusionResult& fused,
    size_t first, size_t last, const Rigid3d& cam_from_imu) {
  const ChainGlobals globals = GlobalsOf(fused);
  Rigid3d body2_from_body1;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (size_t k = first; k < last; ++k) {
    const OdometryLink& link = problem.links[k];
    const bool is_at_rest = link.standstill == StandstillKind::kAtRest;
    if (!link.has_wheel ||
        (!is_at_rest && fused.motions[k].wheel_weight < kSlipWeight)) {
      return std::nullopt;
    }
    const Step step = is_at_rest ? StepAtRest(link)
                                 : StepByWheels(problem, fused, globals, k);
    const Eigen::Quaterniond& rotation =
        fused.motions[k].body2_from_body1.rotation;
    const Eigen::Matrix3d turn = rotation.toRotationMatrix();
    covariance = turn * (covariance + step.covariance) * turn.transpose();
    body2_from_body1 =
        Rigid3d(rotation, rotation * -step.translation) * body2_from_body1;
  }
  const Eigen::Matrix3d turn = cam_from_imu.rotation.toRotationMatrix();
  MeasuredTranslation measured;
  measured.translation =
      (cam_from_imu * body2_from_body1 * cam_from_imu.Inverse()).translation;
  measured.covariance = turn * covariance * turn.transpose();
  return measured;
}

}  // namespace adasfm
