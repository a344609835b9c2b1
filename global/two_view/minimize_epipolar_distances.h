// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "global/view_graph/epipolar.h"

namespace adasfm {

using Matrix5d = Eigen::Matrix<double, 5, 5>;

// 1 sigma of a keypoint, the least noise that is assumed, px.
inline constexpr double kMinKeypointSigmaPx = 0.5;

// x2 ~ rotation * x1 + translation, |translation| = 1.
struct TwoViewPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::UnitZ();
};

// What is known of a rotation, as a quadratic term of the cost.
struct WeightedPrediction {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  // By a rotation vector in camera 2's frame, px^2 / rad^2.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

struct EpipolarMinimization {
  int max_num_iterations = 8;
  // Where the Cauchy loss takes over, px.
  double loss_scale_px = 1.5;
  // Only the direction moves.
  bool hold_rotation = false;
  WeightedPrediction prediction;
};

struct EpipolarMinimum {
  TwoViewPose pose;
  // sum s^2 log(1 + d^2 / s^2) and the prediction's term, px^2.
  double cost = 0.0;
};

// The local minimum of the matches' robust epipolar distances next to a start,
// by Levenberg-Marquardt with the distances' full derivatives.
EpipolarMinimum MinimizeEpipolarDistances(const EpipolarMinimization& options,
                                          const EdgeBearings& bearings,
                                          const TwoViewPose& start);

constexpr int kNumPoseUnknowns = 5;
constexpr int kNumDirectionUnknowns = 2;

struct EpipolarNoise {
  // Of the loss under which the pose was found, px.
  double loss_scale_px = 1.5;
  // Unknowns that were fit to the matches: kNumDirectionUnknowns with the
  // rotation held.
  int num_unknowns = kNumPoseUnknowns;
};

// The information of the matches about the pose at which their cost is least.
struct EpipolarInformation {
  // Inverse covariance by a rotation vector in camera 2's frame and the
  // direction in `basis`, its tangent plane; 1 / rad^2. May be singular.
  Matrix5d matrix = Matrix5d::Zero();
  Eigen::Matrix<double, 3, 2> basis;
  // The cost is this times minus two log-likelihoods, px^2.
  double cost_variance = 1.0;
};

// The inverse of the M-estimator's sandwich covariance. With psi = w d the
// distances after the loss, M = sum w J J^T and means over all matches,
//   covariance = mean(psi^2) mean(w) / mean(psi')^2 M^-1.
// The loss thus does not truncate the noise. Without a baseline
// (DetectBaseline) the directions' block consists of noise alone.
EpipolarInformation ComputeEpipolarInformation(const EpipolarNoise& noise,
                                               const EdgeBearings& bearings,
                                               const TwoViewPose& pose);

}  // namespace adasfm
