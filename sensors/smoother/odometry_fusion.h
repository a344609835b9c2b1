// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/rigid3d.h"
#include "core/types.h"
#include "sensors/preintegration/imu_preintegration.h"
#include "sensors/preintegration/wheel_odometry.h"
#include "sensors/smoother/odometry_fusion_options.h"

namespace adasfm {

// The machine's state at a time; world is z-up with an arbitrary heading.
struct OdometryState {
  Eigen::Quaterniond world_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_in_imu = Eigen::Vector3d::Zero();
  ImuBias bias;
};

enum class StandstillKind {
  kNone,
  kNoTurn,  // it may rock, but keeps its attitude
  kAtRest,
};

// Measurements between two successive states.
struct OdometryLink {
  double dt_s = 0.0;
  bool has_imu = false;
  ImuPreintegration imu;
  // Angular velocity of the body at the link's end minus that at its start,
  // from the gyroscope, rad/s.
  Eigen::Vector3d rate_change = Eigen::Vector3d::Zero();
  bool has_wheel = false;
  WheelMotion wheel;
  // False for wheels that do not observe the yaw (ObservesYaw).
  bool has_wheel_yaw = false;
  StandstillKind standstill = StandstillKind::kNone;
  // At a standstill: the density of the machine's residual rotation,
  // rad/s/sqrt(Hz) about each axis, and the total time of the links of this
  // standstill, s (sensors/smoother/standstill.h).
  Eigen::Vector3d standstill_rate_density = Eigen::Vector3d::Zero();
  double standstill_time_s = 0.0;
  // Within a parked interval (FindParkedIntervals): a standstill whose samples
  // are not used. has_wheel then says that the wheels' log covers it.
  bool is_parked = false;
  // The body's rotation over the link (first_from_second) from the cameras, for
  // links without IMU and wheels (slipping wheels included).
  bool has_vision = false;
  Eigen::Quaterniond visual_rotation = Eigen::Quaterniond::Identity();
  double visual_sigma_rad = 0.0;
};

// Prior of the wheels' yaw: logged yaw = logged_yaw * true yaw - curvature *
// distance (rad/m), with the covariance of (logged_yaw, curvature).
struct WheelYawPrior {
  double logged_yaw = 1.0;
  double curvature = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
};

struct OdometryFusionProblem {
  // link k joins states k and k + 1: one less than states.
  std::vector<OdometryLink> links;
  Rigid3d imu_from_wheel;
  ImuNoise imu_noise;
  // Errors of the wheels' speed may persist for seconds (gravel): the variance
  // of their sum over such a time, divided by that of independent errors with
  // the links' stated variances.
  double wheel_persistence = 1.0;
  // Prior of the gyroscope's bias at the first state, e.g. from vision; where
  // its sigma is 0, the options' sigma applies.
  Eigen::Vector3d prior_gyroscope_bias = Eigen::Vector3d::Zero();
  double prior_gyroscope_bias_sigma = 0.0;
  // Prior of the wheels' yaw, in place of the options' sigmas.
  std::optional<WheelYawPrior> wheel_yaw_prior;
  // First values, e.g. from EstimateInitialOdometry; one more than links.
  std::vector<OdometryState> initial_states;
};

// Motion of the body over one link, with covariance of (rotation,
// translation): R_true = Exp(dtheta) R, t_true = t + dt in the frame of state
// k + 1, as core/relative_pose_prior.h has it.
struct OdometryMotion {
  Rigid3d body2_from_body1;
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6, 6>::Identity();
  double wheel_weight = 1.0;  // < 1: the wheels contradicted the IMU
};

// A link whose wheels differ from the other sensors by more sigmas than this
// loses weight.
inline constexpr double kSlipThresholdSigma = 4.0;
// Wheels with a smaller weight than this count as slipping.
inline constexpr double kSlipWeight = 0.3;

struct WheelSlip {
  timestamp_t start_ns = 0;
  timestamp_t end_ns = 0;
  double speed_error_m_s = 0.0;  // logged minus true, the largest
};

// How the residuals of one kind compare with their stated noise: the sum of
// their squares, whitened, and its expectation (the residuals' redundancy).
struct NoiseCheck {
  double chi2 = 0.0;
  double redundancy = 0.0;

  // True over stated sigma. The stated one weighs as much as kPriorRedundancy
  // residuals.
  static constexpr double kPriorRedundancy = 30.0;
  double Factor() const;
};

struct OdometryFusionResult {
  std::vector<OdometryState> states;
  std::vector<OdometryMotion> motions;  // one per link
  // Links whose wheels contradict the IMU, with logged minus fused speed.
  std::vector<std::pair<size_t, double>> slipping_links;
  // True length = scale * logged length; 1 sigma.
  double wheel_scale = 1.0;
  double wheel_scale_sigma = 0.0;
  // Rotation of the driving direction relative to T_imu_wheel: about its z (to
  // the left) and its y axis (down), rad.
  Eigen::Vector2d driving_direction = Eigen::Vector2d::Zero();
  Eigen::Vector2d driving_direction_sigma = Eigen::Vector2d::Zero();
  // Wheel readings describe the motion this long before their times, s; 1
  // sigma.
  double wheel_delay_s = 0.0;
  double wheel_delay_sigma_s = 0.0;
  // rad/s in the body (IMU) frame: mean over the states, and the mean of their
  // covariances (rad^2/s^2). Without any IMU it is the covariance of the rate
  // error that the errors of track and curvature cause in all links; zero where
  // no wheels observe the yaw.
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();
  Eigen::Matrix3d gyroscope_bias_covariance = Eigen::Matrix3d::Zero();
  double gyroscope_bias_sigma = 0.0;      // mean of states and axes
  double accelerometer_bias_sigma = 0.0;  // mean of states and axes
  // Over moving links: the accelerometer's over links whose wheels have full
  // weight, the wheels' by the median over all.
  NoiseCheck accelerometer_check, wheel_speed_check, wheel_yaw_check;
  // The wheel_persistence that the residuals show, at least 1.
  double wheel_persistence = 1.0;
  // 1 sigma of the speed as a ratio, given the wheels' scale: the median over
  // moving links. Neighbouring links share a length error of this size.
  double speed_sigma_ratio = 0.0;
  int num_iterations = 0;
  bool converged = false;
};

// One least-squares estimate of all states, biases, the wheels' scale and their
// driving direction from all links at once. The normal equations are block
// tridiagonal with a narrow border: time and memory are linear in the number of
// links, and the covariances are the exact marginals of the linearised problem,
// widened where residuals are correlated over seconds
// (smoother/shared_uncertainty.h). Throws std::invalid_argument when options
// are invalid or sizes disagree.
OdometryFusionResult FuseOdometry(const OdometryFusionProblem& problem,
                                  const OdometryFusionOptions& options);

}  // namespace adasfm
