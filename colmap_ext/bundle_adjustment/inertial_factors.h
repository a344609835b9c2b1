// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <set>
#include <vector>

#include "colmap_ext/cost_functions/adjusted_pose.h"
#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"

namespace adasfm {

class BundleProblem;

// The priors beside the factors of these motions among the images: the
// translations that the accelerometer helped to find become the wheels' own, or
// unknown where these slip, so that it does not count twice. Those of other
// motions stay as they are.
std::vector<RelativePosePrior> LeaveAccelerometerToFactors(
    const std::vector<InertialMotion>& motions, const std::set<image_t>& images,
    std::vector<RelativePosePrior> priors);

struct PriorBundleAdjustmentOptions;

// What an accelerometer says of three images in a row, whatever the velocity
// was (core/inertial_motion.h; the velocities of two motions, eliminated). With
// the motions 1 from image 1 to 2 and 2 from 2 to 3, Q the rotations
// world_from_cam, p = C - u Q camera_from_imu_origin the IMU's positions and u
// the model's units a metre, 3 residuals:
//   ((p3 - p2) / dt2 - (p2 - p1) / dt1 - (dt1 + dt2) / 2 g
//    - Q1 (dv1 - dp1 / dt1) - Q2 dp2 / dt2) / sigma
// where dv = u (delta_velocity + e x delta_velocity) + velocity_by_bias b, and
// so for dp: e is the rotation by which T_cam_imu is wrong (shared_errors.h).
// Parameters: AdjustedPose::parameters of the images (6 each), g (3) and b (3)
// in units / s^2, u (1), e (3). The poses are read from the objects, which must
// be up to date.
class InertialCost final : public ceres::CostFunction {
 public:
  // sigma in units / s.
  InertialCost(const InertialMotion& motion1, const InertialMotion& motion2,
               double sigma, const AdjustedPose* pose1,
               const AdjustedPose* pose2, const AdjustedPose* pose3);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  static constexpr int kNumPoses = 3;

  const AdjustedPose* poses_[kNumPoses];
  double mean_dt_s_;
  double inverse_sigma_;
  // What the position of each image counts.
  double by_center_[kNumPoses];
  // What its rotation turns into the world, for each u, the part of it that
  // the IMU measured, and for each b.
  Eigen::Vector3d in_cam_[kNumPoses];
  Eigen::Vector3d measured_[kNumPoses];
  Eigen::Matrix3d by_bias_[kNumPoses];
};

// What was added.
struct InertialTerms {
  // 1 sigma, m/s^2 sqrt(s), before the factor; 0: nothing.
  double noise = 0.0;
  // The parameter u.
  const double* unit = nullptr;
};

// Adds those of motions that follow each other and whose images all take part,
// in a model whose unit is about the metre. Gravity and the unit are unknowns,
// the bias is one for each of some seconds and walks; e is that of the rotation
// priors where motions have wheels, and else zero.
//
// Their noise is the options' accelerometer_noise or, without it, a guess: what
// the poses at the start leave, half of the time. The factor of kVelocity comes
// on top of it. Where too few images take part nothing is added.
InertialTerms AddInertialFactors(const PriorBundleAdjustmentOptions& options,
                                 const std::vector<InertialMotion>& motions,
                                 BundleProblem* bundle);

}  // namespace adasfm
