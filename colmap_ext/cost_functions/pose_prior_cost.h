// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "colmap_ext/cost_functions/adjusted_pose.h"
#include "colmap_ext/cost_functions/pose_prior_edge.h"

namespace adasfm {

// The 2-vector in the tangent plane of unit_reference that leads from it
// towards `vector`; its norm is the angle between the two. Zero, with a zero
// Jacobian, when the vector has no direction; the Jacobian is zero too when the
// two are opposite. basis: 3x2, orthonormal to unit_reference; jacobian
// (optional): d result / d vector.
Eigen::Vector2d DirectionError(const Eigen::Vector3d& vector,
                               const Eigen::Vector3d& unit_reference,
                               const Eigen::Matrix<double, 3, 2>& basis,
                               Eigen::Matrix<double, 2, 3>* jacobian);

// One whitened term of a PosePriorEdge (see there). With R = R_2 R_1^T and
// t = R_2 (C_1 - C_2) of the current poses:
//   kRotation:  Log(R R^^T) / sigma      3 residuals
//   kDirection: DirectionError(t, t^) / sigma  2 residuals
//   kLength:    (|t| - |t^|) / sigma     1 residual
//   kTranslation: (t - t^) / sigma       3 residuals
// Parameters: AdjustedPose::parameters of image 1 (6) and of image 2 (6), then,
// when errors that all priors share affect the edge (shared_errors.h),
//   kRotation: extrinsic_rotation (3), gyroscope_bias of the window (3),
//     gyroscope_scale (3)
//   kDirection, kTranslation: driving_direction (3), direction_drift (3)
//   kLength: direction_drift (3), where length_per_direction > 0
//   kLength, kTranslation: length_scale (1), last, where has_length_scale
//   kRotation: time_shift (1), last, where DependOnTimeShift()
// whose effect on R^ and t^ is subtracted to first order. That of the
// gyroscope's scales g is g o Log(R) with the R of the poses: with the noisy
// R^, g would shrink the residuals. The poses are read from the objects, which
// must be up to date. One cost per term, so that the robust loss can reject a
// wrong term and keep the others.
class PosePriorCost final : public ceres::CostFunction {
 public:
  using Term = PriorTerm;

  // The edge's sigma is multiplied by sigma_factor.
  PosePriorCost(const PosePriorEdge& edge, Term term, double sigma_factor,
                const AdjustedPose* pose1, const AdjustedPose* pose2);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  void EvaluateRotation(double const* const* parameters, double* residuals,
                        double** jacobians) const;
  void EvaluateTranslation(double* residuals, double** jacobians) const;
  // Subtracts the shared errors from the residuals of the poses.
  void SubtractSharedErrors(double const* const* parameters, double* residuals,
                            double** jacobians) const;

  Term term_;
  const AdjustedPose* pose1_;
  const AdjustedPose* pose2_;
  Eigen::Quaterniond rotation_;
  Eigen::Vector3d direction_ = Eigen::Vector3d::UnitZ();
  Eigen::Matrix<double, 3, 2> basis_;
  Eigen::Vector3d translation_;
  double length_ = 0.0;
  double inverse_sigma_ = 1.0;
  // Effect of the first shared parameters, subtracted from the residuals; as
  // many rows as residuals are used.
  std::vector<Eigen::Matrix3d> from_shared_;
  bool has_gyroscope_scale_ = false;
  // The same of the last parameter, a number.
  std::optional<Eigen::Vector3d> from_scalar_;
};

// Sum of weight * value / sigma, 1 residual. Parameters: one of 1 for each
// weight.
class WeightedSumCost final : public ceres::CostFunction {
 public:
  WeightedSumCost(double sigma, std::vector<double> weights);

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  std::vector<double> weights_;  // over sigma
};

// (second - decay * first) / sigma, 3 residuals. Parameters: 3 and 3.
class DifferenceCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  DifferenceCost(double sigma, double decay)
      : inverse_sigma_(1.0 / sigma), decay_(decay) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  double inverse_sigma_;
  double decay_;
};

}  // namespace adasfm
