// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/gap_smoother.h"

#include <algorithm>
#include <cmath>

namespace adasfm {
namespace {

constexpr double kGravityMps2 = 9.81;         // m/s^2
constexpr double kGravitySizeSigma = 0.02;    // m/s^2, of its magnitude
constexpr double kBiasSigma = 0.3;            // m/s^2, an axis
constexpr double kAccelerometerNoise = 0.03;  // m/s^2 sqrt(s)
// Duration on each side: enough for the velocity, gravity and bias.
constexpr double kSideS = 5.0;
constexpr size_t kMaxNumImagesOfSide = 50;

}  // namespace

GapSmoother::GapSmoother(const std::vector<RelativePosePrior>& priors,
                         const std::vector<SizedModel>& models,
                         const DriveChain& chain, const DriveGap& gap)
    : priors_(priors), models_(models), chain_(chain), gap_(gap) {
  first_ = gap.first;
  last_ = gap.last;
  double seconds = 0.0;
  while (first_ > 0 && IsOf(first_ - 1, gap.first) && seconds < kSideS &&
         gap.first - first_ + 1 < kMaxNumImagesOfSide) {
    seconds += chain.motions[--first_]->dt_s;
  }
  seconds = 0.0;
  while (last_ + 1 < chain.images.size() && IsOf(last_ + 1, gap.last) &&
         seconds < kSideS && last_ - gap.last + 1 < kMaxNumImagesOfSide) {
    seconds += chain.motions[last_++]->dt_s;
  }
  FindRotations();
}

double GapSmoother::Seconds() const {
  double seconds = 0.0;
  for (size_t k = gap_.first; k < gap_.last; ++k) {
    seconds += chain_.motions[k]->dt_s;
  }
  return seconds;
}

bool GapSmoother::Solve() {
  // The first solution determines the direction of gravity.
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < 3; ++iteration) {
    BuildEquations(gravity);
    Eigen::SparseMatrix<double> hessian(right_.size(), right_.size());
    hessian.setFromTriplets(hessian_.begin(), hessian_.end());
    factor_.compute(hessian);
    if (factor_.info() != Eigen::Success) return false;
    solution_ = factor_.solve(right_);
    if (!solution_.allFinite()) return false;
    gravity = solution_.segment<3>(Gravity());
  }
  const double chi2 = squares_ - solution_.dot(right_);
  variance_factor_ = std::max(
      1.0,
      chi2 / std::max(1, num_residuals_ - static_cast<int>(right_.size())));
  return true;
}

InertialScale GapSmoother::Scale(bool is_far) const {
  const int size = is_far ? FarSize() : NearSize();
  const Eigen::VectorXd unit = Eigen::VectorXd::Unit(right_.size(), size);
  const double variance = factor_.solve(unit)[size];
  InertialScale scale;
  scale.metres_per_unit = solution_[size];
  scale.sigma_ratio = std::sqrt(variance_factor_ * variance) / solution_[size];
  return scale;
}

std::vector<MeasuredTranslation> GapSmoother::Steps() const {
  const Eigen::Matrix3d covariance = Covariance();
  const double seconds = Seconds();
  std::vector<MeasuredTranslation> steps;
  for (size_t k = gap_.first; k < gap_.last; ++k) {
    const Eigen::Matrix3d cam_from_world =
        WorldFromCam(k + 1).conjugate().toRotationMatrix();
    MeasuredTranslation step;
    step.translation = cam_from_world * (Center(k) - Center(k + 1));
    step.covariance = chain_.motions[k]->dt_s / seconds * cam_from_world *
                      covariance * cam_from_world.transpose();
    steps.push_back(step);
  }
  return steps;
}

void GapSmoother::FindRotations() {
  world_from_cams_.resize(NumImages());
  for (size_t k = first_; k <= gap_.first; ++k) {
    world_from_cams_[k - first_] = CamFromModel(k).rotation.conjugate();
  }
  for (size_t k = gap_.first; k < gap_.last; ++k) {
    const RelativePosePrior& prior = priors_[chain_.priors[k]];
    world_from_cams_[k + 1 - first_] =
        WorldFromCam(k) * prior.cam2_from_cam1.rotation.conjugate();
    rotation_covariance_ += prior.covariance.topLeftCorner<3, 3>();
  }
  near_from_far_ = WorldFromCam(gap_.last) * CamFromModel(gap_.last).rotation;
  for (size_t k = gap_.last + 1; k <= last_; ++k) {
    world_from_cams_[k - first_] =
        near_from_far_ * CamFromModel(k).rotation.conjugate();
  }
}

void GapSmoother::AddEquation(const std::vector<std::pair<int, Factor>>& blocks,
                              const Eigen::Vector3d& value, double sigma) {
  const double information = 1.0 / (sigma * sigma);
  for (const auto& [row, left] : blocks) {
    right_.segment(row, left.cols()) += information * left.transpose() * value;
    for (const auto& [column, across] : blocks) {
      const Eigen::MatrixXd block = information * left.transpose() * across;
      for (int i = 0; i < block.rows(); ++i) {
        for (int j = 0; j < block.cols(); ++j) {
          hessian_.emplace_back(row + i, column + j, block(i, j));
        }
      }
    }
  }
  squares_ += information * value.squaredNorm();
  num_residuals_ += 3;
}

void GapSmoother::BuildEquations(const Eigen::Vector3d& gravity) {
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  const int size = Gravity() + kNumShared;
  hessian_.clear();
  right_ = Eigen::VectorXd::Zero(size);
  squares_ = 0.0;
  num_residuals_ = 0;
  for (size_t k = first_; k <= gap_.first; ++k) {
    AddEquation({{Position(k), one},
                 {NearSize(), CenterInModel(gap_.first) - CenterInModel(k)}},
                -Lever(k), kPositionSigmaM);
  }
  for (size_t k = gap_.last; k <= last_; ++k) {
    AddEquation({{Position(k), one},
                 {FarSide(), one},
                 {FarSize(), near_from_far_ * (CenterInModel(gap_.last) -
                                               CenterInModel(k))}},
                -Lever(k), kPositionSigmaM);
  }
  AddSize(gap_.first, NearSize());
  AddSize(gap_.last, FarSize());
  for (size_t k = first_; k < last_; ++k) AddMotion(k);
  AddEquation({{Bias(), one}}, Eigen::Vector3d::Zero(), kBiasSigma);
  if (gravity.squaredNorm() > 0.0) {
    const Eigen::Vector3d down = gravity.normalized();
    AddEquation({{Gravity(), down * down.transpose()}}, kGravityMps2 * down,
                kGravitySizeSigma);
  }
}

void GapSmoother::AddSize(size_t side, int size) {
  const std::optional<InertialScale>& scale =
      models_[chain_.models[side]].scale;
  if (!scale) return;
  AddEquation({{size, Eigen::Vector3d::UnitX()}},
              scale->metres_per_unit * Eigen::Vector3d::UnitX(),
              scale->metres_per_unit * scale->sigma_ratio);
}

void GapSmoother::AddMotion(size_t k) {
  const InertialMotion& motion = *chain_.motions[k];
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d turn = WorldFromCam(k).toRotationMatrix();
  const double dt = motion.dt_s;
  AddEquation({{Velocity(k + 1), one},
               {Velocity(k), -one},
               {Gravity(), -dt * one},
               {Bias(), -turn * motion.velocity_by_bias}},
              turn * motion.delta_velocity,
              kAccelerometerNoise * std::sqrt(dt));
  // Uses the mean of both velocities, so that the velocity's noise is not in
  // the equation.
  AddEquation({{Position(k + 1), one},
               {Position(k), -one},
               {Velocity(k), -0.5 * dt * one},
               {Velocity(k + 1), -0.5 * dt * one},
               {Bias(), turn * (0.5 * dt * motion.velocity_by_bias -
                                motion.position_by_bias)}},
              turn * (motion.delta_position - 0.5 * dt * motion.delta_velocity),
              kAccelerometerNoise * dt * std::sqrt(dt / 12.0));
}

Eigen::Matrix3d GapSmoother::Covariance() const {
  Eigen::MatrixXd across = Eigen::MatrixXd::Zero(right_.size(), 3);
  across.middleRows<3>(Position(gap_.last)).setIdentity();
  across.middleRows<3>(Position(gap_.first)) -= Eigen::Matrix3d::Identity();
  const Eigen::MatrixXd solved = factor_.solve(across);
  const Eigen::Matrix3d covariance = across.transpose() * solved;
  const double seconds = Seconds();
  const double by_tilt = kGravityMps2 * seconds * seconds / 4.0;
  return variance_factor_ * covariance + by_tilt * by_tilt *
                                             rotation_covariance_.trace() /
                                             3.0 * Eigen::Matrix3d::Identity();
}

}  // namespace adasfm
