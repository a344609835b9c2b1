// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>

#include <Eigen/Core>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/cost_functions/adjusted_pose.h"
#include "core/position_prior.h"

namespace adasfm {

class BundleProblem;

// The whitened error of a position (core/position_prior.h), 3 residuals:
//   L^T (position - (1 - share) A_1 - share A_2),  covariance^-1 = L L^T,
//   A_k = C_k + R_k^T antenna_in_cam.
// Parameters: AdjustedPose::parameters (6) of image 1 and, when it is another
// one, of image 2. The poses are read from the objects, which must be up to
// date.
class PositionCost final : public ceres::CostFunction {
 public:
  // pose2 is pose1 for a position of one image.
  PositionCost(const PositionPrior& prior, const AdjustedPose* pose1,
               const AdjustedPose* pose2);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  PositionPrior prior_;
  const AdjustedPose* pose1_;
  const AdjustedPose* pose2_;
  Eigen::Matrix3d sqrt_information_;
};

// (R^T gravity_in_cam + e_z) / sigma, 3 residuals: the ground is at -z.
// Parameters: AdjustedPose::parameters (6).
class VerticalCost final : public ceres::CostFunction {
 public:
  VerticalCost(const Eigen::Vector3d& gravity_in_cam, double sigma_rad,
               const AdjustedPose* pose);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  Eigen::Vector3d gravity_in_cam_;
  double inverse_sigma_;
  const AdjustedPose* pose_;
};

// With fewer positions the gauge stays free.
inline constexpr int kMinNumPositionsForGauge = 3;

// Adds the problem's positions, with a Cauchy loss from loss_scale sigmas on,
// and the verticals. Positions that are far off where most are near are left
// out. Returns the number of positions; with fewer than
// kMinNumPositionsForGauge nothing is added.
int AddPositionPriors(double loss_scale,
                      const PriorBundleAdjustmentProblem& problem,
                      BundleProblem* bundle);

}  // namespace adasfm
