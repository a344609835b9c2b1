// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/odometry_factors.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

constexpr int kFirst = 0;
constexpr int kSecond = ChainState::kSize;
constexpr int kGlobals = 2 * ChainState::kSize;
// No link has more residuals: IMU 9, biases 6, wheels 3, rotation 3, rest 12,
// planar 2, weak priors 9.
constexpr int kMaxResiduals = 48;

// Weak priors: they keep coordinates without any sensor finite.
constexpr double kWeakSpeedSigma = 50.0;  // m/s
constexpr double kWeakStepSigma = 100.0;  // m
constexpr double kWeakAngleSigma = 1.0;   // rad
// Over this time an unaided machine's speed forgets its past, seconds.
constexpr double kSpeedMemoryS = 10.0;

// Collects whitened rows of one link.
class LinkBuilder {
 public:
  LinkBuilder(const LinkContext& context, const OdometryLink& link,
              const ChainState& first, const ChainState& second,
              const ChainGlobals& globals)
      : context_(context),
        link_(link),
        first_(first),
        second_(second),
        globals_(globals),
        r1_transposed_(
            first.state.world_from_imu.toRotationMatrix().transpose()),
        r2_(second.state.world_from_imu.toRotationMatrix()),
        a_rotation_(first.state.world_from_imu.conjugate() *
                    second.state.world_from_imu),
        a_(a_rotation_.toRotationMatrix()) {
    values_.setZero();
    jacobian_.setZero();
  }

  void AddImu();
  void AddBiasWalk();
  void AddWheel(double weight);
  void AddStandstill();
  void AddWeakPriors();

  LinkResiduals Finish() const {
    LinkResiduals result;
    result.values = values_.head(num_rows_);
    result.jacobian = jacobian_.topRows(num_rows_);
    result.wheel_chi2 = wheel_chi2_;
    return result;
  }

 private:
  // d v(A) where dA = A Exp(x), x = R2^T (d2 - d1): writes the derivative of a
  // row block by the two rotations.
  template <int N>
  void AddRelativeRotation(int row,
                           const Eigen::Matrix<double, N, 3>& by_turn) {
    const Eigen::Matrix<double, N, 3> by_world = by_turn * r2_.transpose();
    jacobian_.block<N, 3>(row, kSecond + ChainState::kRotation) += by_world;
    jacobian_.block<N, 3>(row, kFirst + ChainState::kRotation) -= by_world;
  }

  // A vector residual of the relative rotation alone, sigma per axis.
  void AddRotationResidual(const Eigen::Quaterniond& measured,
                           const Eigen::Matrix3d& covariance) {
    const Eigen::Vector3d error = LogSo3(measured.conjugate() * a_rotation_);
    values_.segment<3>(num_rows_) = error;
    AddRelativeRotation<3>(num_rows_, RightJacobianInverseSo3(error));
    Whiten<3>(covariance);
  }

  // A scalar prior on one coordinate.
  void AddScalar(int column, double error, double sigma) {
    values_[num_rows_] = error / sigma;
    jacobian_(num_rows_, column) = 1.0 / sigma;
    ++num_rows_;
  }

  void AddVector(int column, const Eigen::Vector3d& error, double sigma) {
    for (int i = 0; i < 3; ++i) AddScalar(column + i, error[i], sigma);
  }

  // Multiplies the last N rows by the inverse root of their covariance.
  template <int N>
  void Whiten(const Eigen::Matrix<double, N, N>& covariance) {
    const Eigen::LLT<Eigen::Matrix<double, N, N>> llt(covariance);
    auto values = values_.segment<N>(num_rows_);
    auto jacobian = jacobian_.middleRows<N>(num_rows_);
    llt.matrixL().solveInPlace(values);
    llt.matrixL().solveInPlace(jacobian);
    num_rows_ += N;
  }

  void AddWheelYaw(double weight);
  void AddPlanarRotation();

  const LinkContext& context_;
  const OdometryLink& link_;
  const ChainState& first_;
  const ChainState& second_;
  const ChainGlobals& globals_;
  const Eigen::Matrix3d r1_transposed_;
  const Eigen::Matrix3d r2_;
  const Eigen::Quaterniond a_rotation_;
  const Eigen::Matrix3d a_;
  int num_rows_ = 0;
  double wheel_chi2_ = 0.0;
  Eigen::Matrix<double, kMaxResiduals, 1> values_;
  Eigen::Matrix<double, kMaxResiduals, kLinkSize> jacobian_;
};

void LinkBuilder::AddImu() {
  const ImuPreintegration& imu = link_.imu;
  const ImuBias& bias = first_.state.bias;
  const double dt = imu.dt_s;
  const Eigen::Vector3d gravity(0.0, 0.0, -context_.options->gravity_m_s2);
  const Eigen::Vector3d gravity_in_body = r1_transposed_ * gravity;
  const Eigen::Matrix3d gravity_by_rotation = r1_transposed_ * Hat(gravity);
  const Eigen::Vector3d& v1 = first_.state.velocity_in_imu;
  const Eigen::Vector3d& v2 = second_.state.velocity_in_imu;
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const int row = num_rows_;
  auto block = [&](int block_row, int column) {
    return jacobian_.block<3, 3>(row + block_row, column);
  };

  const Eigen::Vector3d error =
      LogSo3(imu.CorrectedRotation(bias).conjugate() * a_rotation_);
  values_.segment<3>(row) = error;
  AddRelativeRotation<3>(row, RightJacobianInverseSo3(error));
  const Eigen::Vector3d correction =
      imu.rotation_by_gyroscope * (bias.gyroscope - imu.bias.gyroscope);
  block(0, kFirst + ChainState::kGyro) = -RightJacobianInverseSo3(-error) *
                                         RightJacobianSo3(correction) *
                                         imu.rotation_by_gyroscope;

  values_.segment<3>(row + 3) =
      a_ * v2 - v1 - gravity_in_body * dt - imu.CorrectedVelocity(bias);
  AddRelativeRotation<3>(row + 3, -a_ * Hat(v2));
  block(3, kFirst + ChainState::kRotation) -= dt * gravity_by_rotation;
  block(3, kFirst + ChainState::kVelocity) = -identity;
  block(3, kSecond + ChainState::kVelocity) = a_;
  block(3, kFirst + ChainState::kGyro) = -imu.velocity_by_gyroscope;
  block(3, kFirst + ChainState::kAccel) = -imu.velocity_by_accelerometer;

  values_.segment<3>(row + 6) = second_.step_in_previous - v1 * dt -
                                0.5 * dt * dt * gravity_in_body -
                                imu.CorrectedPosition(bias);
  block(6, kFirst + ChainState::kRotation) =
      -0.5 * dt * dt * gravity_by_rotation;
  block(6, kFirst + ChainState::kVelocity) = -dt * identity;
  block(6, kSecond + ChainState::kStep) = identity;
  block(6, kFirst + ChainState::kGyro) = -imu.position_by_gyroscope;
  block(6, kFirst + ChainState::kAccel) = -imu.position_by_accelerometer;
  Whiten<9>(imu.covariance);
}

void LinkBuilder::AddBiasWalk() {
  const ImuNoise& noise = context_.problem->imu_noise;
  const double root_dt = std::sqrt(std::max(link_.dt_s, 1e-6));
  const auto add = [&](int offset, const Eigen::Vector3d& difference,
                       double sigma) {
    for (int i = 0; i < 3; ++i) {
      jacobian_(num_rows_, kFirst + offset + i) = -1.0 / sigma;
      AddScalar(kSecond + offset + i, difference[i], sigma);
    }
  };
  const ImuBias& b1 = first_.state.bias;
  const ImuBias& b2 = second_.state.bias;
  add(ChainState::kGyro, b2.gyroscope - b1.gyroscope,
      noise.gyroscope_random_walk * root_dt);
  add(ChainState::kAccel, b2.accelerometer - b1.accelerometer,
      noise.accelerometer_random_walk * root_dt);
}

void LinkBuilder::AddWheel(double weight) {
  const WheelMotion& wheel = link_.wheel;
  const Eigen::Vector3d& lever = context_.problem->imu_from_wheel.translation;
  Eigen::Matrix<double, 3, 2> forward_by_mount;
  const Eigen::Vector3d forward = globals_.Forward(
      context_.problem->imu_from_wheel.rotation, &forward_by_mount);
  const double logged_per_true = globals_.values[ChainGlobals::kLoggedLength];
  const Eigen::Vector3d phi =
      LogSo3(wheel.profile_rotation.conjugate() * a_rotation_);
  const Eigen::Matrix3d map =
      wheel.displacement_map + wheel.rotation_moment * Hat(phi);
  // What the wheel frame's origin moves by.
  const Eigen::Vector3d moved = second_.step_in_previous + a_ * lever - lever;
  const int row = num_rows_;
  values_.segment<3>(row) = logged_per_true * moved - map * forward;
  jacobian_.block<3, 3>(row, kSecond + ChainState::kStep) =
      logged_per_true * Eigen::Matrix3d::Identity();
  AddRelativeRotation<3>(row, -logged_per_true * a_ * Hat(lever) +
                                  wheel.rotation_moment * Hat(forward) *
                                      RightJacobianInverseSo3(phi));
  jacobian_.block<3, 1>(row, kGlobals + ChainGlobals::kLoggedLength) = moved;
  jacobian_.block<3, 2>(row, kGlobals + ChainGlobals::kMountYaw) =
      -map * forward_by_mount;
  Whiten<3>(wheel.covariance / weight);
  wheel_chi2_ +=
      weight > 0.0 ? values_.segment<3>(row).squaredNorm() / weight : 0.0;
  if (wheel.has_rotation) {
    AddRotationResidual(wheel.rotation, wheel.rotation_covariance / weight);
    wheel_chi2_ += values_.segment<3>(row + 3).squaredNorm() / weight;
    return;
  }
  if (link_.has_wheel_yaw) AddWheelYaw(weight);
  if (!link_.has_imu) AddPlanarRotation();
}

void LinkBuilder::AddWheelYaw(double weight) {
  const WheelMotion& wheel = link_.wheel;
  const Eigen::Vector3d up =
      context_.problem->imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d turn = LogSo3(a_rotation_);
  const double root_weight = std::sqrt(weight / wheel.yaw_variance);
  const int row = num_rows_++;
  const double logged_per_true = globals_.values[ChainGlobals::kLoggedYaw];
  values_[row] = root_weight *
                 (logged_per_true * up.dot(turn) -
                  globals_.values[ChainGlobals::kCurvature] * wheel.distance_m -
                  wheel.yaw_rad);
  AddRelativeRotation<1>(row, root_weight * logged_per_true * up.transpose() *
                                  RightJacobianInverseSo3(turn));
  jacobian_(row, kGlobals + ChainGlobals::kLoggedYaw) =
      root_weight * up.dot(turn);
  jacobian_(row, kGlobals + ChainGlobals::kCurvature) =
      -root_weight * wheel.distance_m;
  wheel_chi2_ += values_[row] * values_[row] / weight;
}

void LinkBuilder::AddPlanarRotation() {
  const Eigen::Matrix3d wheel_from_imu =
      context_.problem->imu_from_wheel.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d turn = LogSo3(a_rotation_);
  const double sigma = context_.options->planar_rotation_noise *
                       std::sqrt(std::max(link_.dt_s, 1e-6));
  const Eigen::Matrix<double, 2, 3> by_turn =
      wheel_from_imu.topRows<2>() * RightJacobianInverseSo3(turn) / sigma;
  values_.segment<2>(num_rows_) = wheel_from_imu.topRows<2>() * turn / sigma;
  AddRelativeRotation<2>(num_rows_, by_turn);
  num_rows_ += 2;
}

void LinkBuilder::AddStandstill() {
  const OdometryFusionOptions& options = *context_.options;
  const double dt = std::max(link_.dt_s, 1e-3);
  const double angle = options.standstill_rate_sigma * dt;
  AddRotationResidual(Eigen::Quaterniond::Identity(),
                      angle * angle * Eigen::Matrix3d::Identity());
  if (link_.standstill != StandstillKind::kAtRest) return;
  AddVector(kSecond + ChainState::kStep, second_.step_in_previous,
            options.standstill_speed_sigma * dt);
  AddVector(kFirst + ChainState::kVelocity, first_.state.velocity_in_imu,
            options.standstill_speed_sigma);
  AddVector(kSecond + ChainState::kVelocity, second_.state.velocity_in_imu,
            options.standstill_speed_sigma);
}

void LinkBuilder::AddWeakPriors() {
  const Eigen::Vector3d& velocity = second_.state.velocity_in_imu;
  const Eigen::Vector3d& step = second_.step_in_previous;
  if (!link_.has_imu) {
    AddVector(kSecond + ChainState::kVelocity, velocity, kWeakSpeedSigma);
  } else if (!link_.has_wheel) {
    // Independent at every state, hence spread over the speed's memory.
    const double memory = 2.0 * kSpeedMemoryS / std::max(link_.dt_s, 1e-3);
    AddVector(kSecond + ChainState::kVelocity, velocity,
              context_.options->unaided_speed_sigma *
                  std::sqrt(std::max(1.0, memory)));
  }
  if (link_.has_imu || link_.has_wheel) {
    const bool has_rotation =
        link_.has_imu || link_.has_wheel_yaw || link_.wheel.has_rotation;
    if (has_rotation) return;
  } else {
    AddVector(kSecond + ChainState::kStep, step, kWeakStepSigma);
  }
  AddRotationResidual(
      Eigen::Quaterniond::Identity(),
      kWeakAngleSigma * kWeakAngleSigma * Eigen::Matrix3d::Identity());
}

}  // namespace

void ChainState::Retract(const Eigen::Matrix<double, kSize, 1>& delta) {
  const Eigen::Quaterniond tilt =
      ExpSo3(Eigen::Vector3d(delta[0], delta[1], 0.0));
  const Eigen::Quaterniond heading =
      ExpSo3(Eigen::Vector3d(0.0, 0.0, delta[2]));
  state.world_from_imu = (heading * tilt * state.world_from_imu).normalized();
  state.velocity_in_imu += delta.segment<3>(kVelocity);
  state.bias.gyroscope += delta.segment<3>(kGyro);
  state.bias.accelerometer += delta.segment<3>(kAccel);
  step_in_previous += delta.segment<3>(kStep);
}

ChainGlobals::Vector ChainGlobals::PriorSigmas(
    const OdometryFusionOptions& options) {
  // Zero means exactly known: a sigma too small to move anything.
  constexpr double kFixed = 1e-7;
  const double mount = DegToRad(options.wheel_mount_sigma_deg);
  Vector sigmas;
  sigmas << options.wheel_scale_sigma, options.wheel_track_sigma,
      options.wheel_curvature_sigma, mount, mount;
  return sigmas.cwiseMax(kFixed);
}

Eigen::Vector3d ChainGlobals::Forward(
    const Eigen::Quaterniond& imu_from_wheel,
    Eigen::Matrix<double, 3, 2>* jacobian) const {
  const double cy = std::cos(values[kMountYaw]);
  const double sy = std::sin(values[kMountYaw]);
  const double cp = std::cos(values[kMountPitch]);
  const double sp = std::sin(values[kMountPitch]);
  const Eigen::Matrix3d rotation = imu_from_wheel.toRotationMatrix();
  if (jacobian != nullptr) {
    jacobian->col(0) = rotation * Eigen::Vector3d(-cp * sy, cp * cy, 0.0);
    jacobian->col(1) = rotation * Eigen::Vector3d(-sp * cy, -sp * sy, -cp);
  }
  return rotation * Eigen::Vector3d(cp * cy, cp * sy, -sp);
}

LinkResiduals ComputeLinkResiduals(const LinkContext& context,
                                   const OdometryLink& link,
                                   const ChainState& first,
                                   const ChainState& second,
                                   const ChainGlobals& globals,
                                   double wheel_weight) {
  LinkBuilder builder(context, link, first, second, globals);
  if (link.has_imu) builder.AddImu();
  builder.AddBiasWalk();
  if (link.has_wheel) builder.AddWheel(wheel_weight);
  if (link.standstill != StandstillKind::kNone) builder.AddStandstill();
  builder.AddWeakPriors();
  return builder.Finish();
}

}  // namespace adasfm
