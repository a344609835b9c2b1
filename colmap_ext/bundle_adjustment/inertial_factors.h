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

// Returns the priors to use beside the factors of these motions among the
// images. Translations that the accelerometer helped to estimate become those
// of the wheels alone, or unknown where wheels slip, so that the accelerometer
// does not count twice. Priors of other motions are unchanged.
std::vector<RelativePosePrior> LeaveAccelerometerToFactors(
    const std::vector<InertialMotion>& motions, const std::set<image_t>& images,
    std::vector<RelativePosePrior> priors);

struct PriorBundleAdjustmentOptions;

// The accelerometer's constraint on three consecutive images, with the
// velocities of both motions eliminated (core/inertial_motion.h). With motion 1
// from image 1 to 2 and motion 2 from 2 to 3, Q the rotations world_from_cam,
// p = C - u Q camera_from_imu_origin the IMU's positions and u the model's
// units per metre, 3 residuals:
//   ((p3 - p2) / dt2 - (p2 - p1) / dt1 - (dt1 + dt2) / 2 g
//    - Q1 (dv1 - dp1 / dt1) - Q2 dp2 / dt2) / sigma
// where dv = u (delta_velocity + e x delta_velocity) + velocity_by_bias b, and
// dp likewise; e is the rotation error of T_cam_imu (shared_errors.h).
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
  // Coefficients of the positions.
  double by_center_[kNumPoses];
  // Vectors that the rotations transform into the world: coefficients of u,
  // their part that the IMU measured, and coefficients of b.
  Eigen::Vector3d in_cam_[kNumPoses];
  Eigen::Vector3d measured_[kNumPoses];
  Eigen::Matrix3d by_bias_[kNumPoses];
};

// The terms that were added.
struct InertialTerms {
  // 1 sigma, m/s^2 sqrt(s), before the factor of kVelocity; 0: no terms.
  double noise = 0.0;
  // The parameter u.
  const double* unit = nullptr;
};

// Adds the factors of consecutive motions whose images all take part, in a
// model whose unit is about the metre. Unknowns are gravity, the unit and a
// bias for each window of some seconds, a random walk. Where motions have
// wheels, e is that of the rotation priors; else it is held at zero.
//
// The noise is the options' accelerometer_noise or, without it, a guess: the
// median residual at the initial poses. The factor of kVelocity multiplies it.
// Where too few images take part nothing is added.
InertialTerms AddInertialFactors(const PriorBundleAdjustmentOptions& options,
                                 const std::vector<InertialMotion>& motions,
                                 BundleProblem* bundle);

}  // namespace adasfm
