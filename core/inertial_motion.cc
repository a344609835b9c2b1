// SPDX-License-Identifier: BSD-3-Clause
#include "core/inertial_motion.h"

#include <algorithm>
#include <map>
#include <utility>

namespace adasfm {

void RotateInertialMotion(const Eigen::Quaterniond& rotated_from_cam,
                          InertialMotion* motion) {
  const Eigen::Matrix3d rotation = rotated_from_cam.toRotationMatrix();
  motion->delta_velocity = rotation * motion->delta_velocity;
  motion->delta_position = rotation * motion->delta_position;
  motion->velocity_by_bias =
      rotation * motion->velocity_by_bias * rotation.transpose();
  motion->position_by_bias =
      rotation * motion->position_by_bias * rotation.transpose();
  for (Eigen::Vector3d* vector :
       {&motion->velocity_by_time_shift, &motion->position_by_time_shift,
        &motion->translation_by_time_shift, &motion->camera_from_imu_origin}) {
    *vector = rotation * *vector;
  }
  if (!motion->by_wheels) return;
  MeasuredTranslation& by_wheels = *motion->by_wheels;
  by_wheels.translation = rotation * by_wheels.translation;
  by_wheels.covariance = rotation * by_wheels.covariance * rotation.transpose();
}

void AddTimeShift(double shift_s, InertialMotion* motion) {
  motion->delta_velocity += shift_s * motion->velocity_by_time_shift;
  motion->delta_position += shift_s * motion->position_by_time_shift;
  if (!motion->by_wheels) return;
  motion->by_wheels->translation += shift_s * motion->translation_by_time_shift;
}

void SetTranslation(const MeasuredTranslation& measured,
                    RelativePosePrior* prior) {
  prior->cam2_from_cam1.translation = measured.translation;
  prior->covariance.bottomRows<3>().setZero();
  prior->covariance.rightCols<3>().setZero();
  prior->covariance.bottomRightCorner<3, 3>() = measured.covariance;
}

double AddInertialLengths(const std::vector<InertialLength>& lengths,
                          std::vector<RelativePosePrior>* priors) {
  std::map<std::pair<image_t, image_t>, const InertialLength*> by_pair;
  for (const InertialLength& length : lengths) {
    by_pair[{length.image_id1, length.image_id2}] = &length;
  }
  double scale_sigma = 0.0;
  for (RelativePosePrior& prior : *priors) {
    const auto found = by_pair.find({prior.image_id1, prior.image_id2});
    if (found == by_pair.end() || prior.HasLength()) continue;
    const InertialLength& length = *found->second;
    prior.flags |= kPriorLength | kPriorInertialLength;
    MeasuredTranslation measured;
    if (length.bridge) {
      prior.flags |= kPriorDirection;
      measured = *length.bridge;
    } else {
      measured.translation = length.length_m * Eigen::Vector3d::UnitZ();
      measured.covariance *= length.sigma_m * length.sigma_m;
    }
    SetTranslation(measured, &prior);
    scale_sigma = std::max(scale_sigma, length.scale_sigma);
  }
  return scale_sigma;
}

}  // namespace adasfm
