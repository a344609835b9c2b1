// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/inertial_factors.h"

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

using PoseJacobian = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;
using Jacobian3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// 1 sigma, per axis, of a bias, and of its walk over a second: five times the
// figure of a usual chip, since errors of the axes' scales and of the tilt vary
// with the motion, too.
constexpr double kBiasSigmaMps2 = 0.3;
constexpr double kBiasWalk = 1e-3;
constexpr double kBiasWindowS = 5.0;
// 1 sigma of the unit, which was estimated from the same log.
constexpr double kUnitSigma = 0.2;
// Fewer factors do not determine gravity, bias, unit and noise.
constexpr size_t kMinNumFactors = 10;
constexpr double kMinNoise = 1e-4;

// The unknowns that all factors share.
struct SharedMotion {
  std::vector<double> gravity = {0.0, 0.0, 0.0};
  std::vector<double> bias = {0.0, 0.0, 0.0};
  std::vector<double> unit = {1.0};
};

struct Factor {
  const InertialMotion* motion1 = nullptr;
  const InertialMotion* motion2 = nullptr;
  std::vector<image_t> images;
  const AdjustedPose* poses[3] = {nullptr, nullptr, nullptr};

  // 1 sigma for white noise of 1. One factor alone errs by sqrt(2/3) of it, but
  // shares half of its time with its neighbours. Their joint error, which
  // deforms a model and which vision can contradict, is that of independent
  // factors with this sigma.
  double UnitSigma() const {
    return std::sqrt(0.5 * (motion1->dt_s + motion2->dt_s));
  }
  std::unique_ptr<InertialCost> Cost(double noise) const {
    return std::make_unique<InertialCost>(
        *motion1, *motion2, noise * UnitSigma(), poses[0], poses[1], poses[2]);
  }
};

// The first of each two consecutive motions where has_image holds for all three
// images.
template <typename HasImage>
std::vector<size_t> FindMotionPairs(const std::vector<InertialMotion>& motions,
                                    const HasImage& has_image) {
  std::vector<size_t> firsts;
  for (size_t k = 0; k + 1 < motions.size(); ++k) {
    if (motions[k].image_id2 == motions[k + 1].image_id1 &&
        has_image(motions[k].image_id1) && has_image(motions[k].image_id2) &&
        has_image(motions[k + 1].image_id2)) {
      firsts.push_back(k);
    }
  }
  return firsts;
}

std::vector<Factor> FindFactors(const std::vector<InertialMotion>& motions,
                                const BundleProblem& bundle) {
  std::vector<Factor> factors;
  for (const size_t k : FindMotionPairs(motions, [&bundle](image_t image_id) {
         return bundle.UsedPose(image_id) != nullptr;
       })) {
    Factor factor;
    factor.motion1 = &motions[k];
    factor.motion2 = &motions[k + 1];
    factor.images = {motions[k].image_id1, motions[k].image_id2,
                     motions[k + 1].image_id2};
    bool is_free = false;
    for (size_t i = 0; i < factor.images.size(); ++i) {
      factor.poses[i] = bundle.UsedPose(factor.images[i]);
      is_free = is_free || !bundle.IsConstant(factor.images[i]);
    }
    if (is_free) factors.push_back(std::move(factor));
  }
  return factors;
}

// Fits the unknowns at fixed poses, robustly (Cauchy) with the median as scale.
// Returns the noise.
double FitSharedMotion(const std::vector<Factor>& factors,
                       const double* extrinsic_rotation, SharedMotion* shared) {
  constexpr int kNumUnknowns = 7;
  constexpr int kNumIterations = 10;
  using Vector = Eigen::Matrix<double, kNumUnknowns, 1>;
  using Matrix = Eigen::Matrix<double, kNumUnknowns, kNumUnknowns>;
  Vector x = Vector::Unit(kNumUnknowns - 1);
  double noise = 0.0;
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    Matrix hessian = Matrix::Zero();
    Vector gradient = Vector::Zero();
    std::vector<double> norms;
    for (const Factor& factor : factors) {
      const double* parameters[] = {
          nullptr,      nullptr,      nullptr,           x.data(),
          x.data() + 3, x.data() + 6, extrinsic_rotation};
      Eigen::Vector3d residuals;
      Jacobian3 by_gravity, by_bias;
      Eigen::Vector3d by_unit;
      double* jacobians[] = {
          nullptr,        nullptr,        nullptr, by_gravity.data(),
          by_bias.data(), by_unit.data(), nullptr};
      factor.Cost(1.0)->Evaluate(parameters, residuals.data(), jacobians);
      norms.push_back(residuals.norm());
      Eigen::Matrix<double, 3, kNumUnknowns> jacobian;
      jacobian << by_gravity, by_bias, by_unit;
      const double ratio = noise > 0.0 ? residuals.norm() / (3.0 * noise) : 0.0;
      const double weight = 1.0 / (1.0 + ratio * ratio);
      hessian += weight * jacobian.transpose() * jacobian;
      gradient += weight * jacobian.transpose() * residuals;
    }
    noise = std::max(kMinNoise, UpperMedian(&norms) / kMedianNorm3);
    const auto hold_back = [&](int index, double sigma, double value) {
      const double weight = std::pow(noise / sigma, 2);
      hessian(index, index) += weight;
      gradient[index] += weight * (x[index] - value);
    };
    for (int axis = 0; axis < 3; ++axis) {
      hold_back(3 + axis, kBiasSigmaMps2, 0.0);
    }
    hold_back(6, kUnitSigma, 1.0);
    const Vector step = hessian.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    x -= step;
  }
  shared->gravity.assign(x.data(), x.data() + 3);
  shared->bias.assign(x.data() + 3, x.data() + 6);
  shared->unit.assign(1, x[6]);
  return noise;
}

void AddNormalPrior(double sigma, std::vector<double> mean, double* parameters,
                    BundleProblem* bundle) {
  const auto size = static_cast<Eigen::Index>(mean.size());
  bundle->AddResidual(std::make_unique<ceres::NormalPrior>(
                          Eigen::MatrixXd::Identity(size, size) / sigma,
                          Eigen::Map<const Eigen::VectorXd>(mean.data(), size)),
                      nullptr, {}, {parameters});
}

}  // namespace

InertialCost::InertialCost(const InertialMotion& motion1,
                           const InertialMotion& motion2, double sigma,
                           const AdjustedPose* pose1, const AdjustedPose* pose2,
                           const AdjustedPose* pose3)
    : poses_{pose1, pose2, pose3},
      mean_dt_s_(0.5 * (motion1.dt_s + motion2.dt_s)),
      inverse_sigma_(1.0 / sigma),
      by_center_{1.0 / motion1.dt_s, -1.0 / motion1.dt_s - 1.0 / motion2.dt_s,
                 1.0 / motion2.dt_s} {
  measured_[0] = motion1.delta_velocity - motion1.delta_position / motion1.dt_s;
  measured_[1] = motion2.delta_position / motion2.dt_s;
  measured_[2].setZero();
  for (int k = 0; k < kNumPoses; ++k) {
    in_cam_[k] = measured_[k] + by_center_[k] * motion1.camera_from_imu_origin;
  }
  by_bias_[0] =
      motion1.velocity_by_bias - motion1.position_by_bias / motion1.dt_s;
  by_bias_[1] = motion2.position_by_bias / motion2.dt_s;
  by_bias_[2].setZero();
  set_num_residuals(3);
  *mutable_parameter_block_sizes() = {6, 6, 6, 3, 3, 1, 3};
}

bool InertialCost::Evaluate(double const* const* parameters, double* residuals,
                            double** jacobians) const {
  const Eigen::Map<const Eigen::Vector3d> gravity(parameters[kNumPoses]);
  const Eigen::Map<const Eigen::Vector3d> bias(parameters[kNumPoses + 1]);
  const double unit = *parameters[kNumPoses + 2];
  const Eigen::Map<const Eigen::Vector3d> turn(parameters[kNumPoses + 3]);
  Eigen::Vector3d error = -mean_dt_s_ * gravity;
  Eigen::Matrix3d error_by_bias = Eigen::Matrix3d::Zero();
  Eigen::Vector3d error_by_unit = Eigen::Vector3d::Zero();
  Eigen::Matrix3d error_by_rotation = Eigen::Matrix3d::Zero();
  for (int k = 0; k < kNumPoses; ++k) {
    const Eigen::Matrix3d world_from_cam = poses_[k]->rotation.transpose();
    error += by_center_[k] * poses_[k]->center;
    error_by_bias -= world_from_cam * by_bias_[k];
    error_by_unit -= world_from_cam * (in_cam_[k] + turn.cross(measured_[k]));
    error_by_rotation += unit * world_from_cam * Hat(measured_[k]);
  }
  error += error_by_bias * bias + error_by_unit * unit;
  Eigen::Map<Eigen::Vector3d> whitened(residuals);
  whitened = inverse_sigma_ * error;
  if (jacobians == nullptr) return true;
  for (int k = 0; k < kNumPoses; ++k) {
    if (jacobians[k] == nullptr) continue;
    Eigen::Map<PoseJacobian> jacobian(jacobians[k]);
    jacobian.leftCols<3>() =
        -inverse_sigma_ *
        RotatedBackJacobian(*poses_[k],
                            unit * (in_cam_[k] + turn.cross(measured_[k])) +
                                by_bias_[k] * bias);
    jacobian.rightCols<3>() =
        inverse_sigma_ * by_center_[k] * Eigen::Matrix3d::Identity();
  }
  if (jacobians[kNumPoses] != nullptr) {
    Eigen::Map<Jacobian3> jacobian(jacobians[kNumPoses]);
    jacobian = -inverse_sigma_ * mean_dt_s_ * Eigen::Matrix3d::Identity();
  }
  if (jacobians[kNumPoses + 1] != nullptr) {
    Eigen::Map<Jacobian3> jacobian(jacobians[kNumPoses + 1]);
    jacobian = inverse_sigma_ * error_by_bias;
  }
  if (jacobians[kNumPoses + 2] != nullptr) {
    Eigen::Map<Eigen::Vector3d> jacobian(jacobians[kNumPoses + 2]);
    jacobian = inverse_sigma_ * error_by_unit;
  }
  if (jacobians[kNumPoses + 3] != nullptr) {
    Eigen::Map<Jacobian3> jacobian(jacobians[kNumPoses + 3]);
    jacobian = inverse_sigma_ * error_by_rotation;
  }
  return true;
}

void BundleProblem::AddVelocityTerm(std::unique_ptr<ceres::CostFunction> cost,
                                    const std::vector<image_t>& image_ids,
                                    const std::vector<double*>& parameters) {
  PriorBlock block;
  block.residual =
      AddResidual(std::move(cost),
                  std::make_unique<ceres::HuberLoss>(options_.prior_loss_scale),
                  image_ids, parameters);
  block.term = PriorTerm::kVelocity;
  prior_blocks_.push_back(block);
}

std::vector<RelativePosePrior> LeaveAccelerometerToFactors(
    const std::vector<InertialMotion>& motions, const std::set<image_t>& images,
    std::vector<RelativePosePrior> priors) {
  const std::vector<size_t> pairs = FindMotionPairs(
      motions,
      [&images](image_t image_id) { return images.count(image_id) > 0; });
  if (pairs.size() < kMinNumFactors) return priors;
  std::map<std::pair<image_t, image_t>, const InertialMotion*> in_factor;
  for (const size_t k : pairs) {
    for (const InertialMotion* motion : {&motions[k], &motions[k + 1]}) {
      in_factor[{motion->image_id1, motion->image_id2}] = motion;
    }
  }
  for (RelativePosePrior& prior : priors) {
    const auto found = in_factor.find({prior.image_id1, prior.image_id2});
    if (found == in_factor.end() || !prior.HasOwnLength()) continue;
    const auto& by_wheels = found->second->by_wheels;
    if (!by_wheels) {
      prior.flags &= ~(kPriorDirection | kPriorLength | kPriorInertialLength);
      continue;
    }
    SetTranslation(*by_wheels, &prior);
  }
  return priors;
}

InertialTerms AddInertialFactors(const PriorBundleAdjustmentOptions& options,
                                 const std::vector<InertialMotion>& motions,
                                 BundleProblem* bundle) {
  const std::vector<Factor> factors = FindFactors(motions, *bundle);
  if (factors.size() < kMinNumFactors) return {};
  SharedMotion shared;
  // Without lengths the model's shape would follow the rotation error.
  const bool has_lengths = std::any_of(
      factors.begin(), factors.end(),
      [](const Factor& factor) { return factor.motion1->by_wheels; });
  double* held_turn =
      has_lengths ? nullptr : bundle->AddParameters({0.0, 0.0, 0.0});
  const double no_turn[] = {0.0, 0.0, 0.0};
  const double noise_at_start = FitSharedMotion(factors, no_turn, &shared);
  const double noise = options.accelerometer_noise > 0.0
                           ? options.accelerometer_noise
                           : noise_at_start;
  const double sigma_factor =
      options.prior_sigma_factors[static_cast<size_t>(PriorTerm::kVelocity)];
  double* gravity = bundle->AddParameters(shared.gravity);
  double* unit = bundle->AddParameters(shared.unit);
  AddNormalPrior(kUnitSigma, {1.0}, unit, bundle);
  std::optional<int> drive;
  double* bias = nullptr;
  double seconds = 0.0;
  for (const Factor& factor : factors) {
    if (drive != factor.motion1->drive) {
      drive = factor.motion1->drive;
      bias = bundle->AddParameters(shared.bias);
      AddNormalPrior(kBiasSigmaMps2, {0.0, 0.0, 0.0}, bias, bundle);
      seconds = 0.0;
    } else if (seconds >= kBiasWindowS) {
      double* next = bundle->AddParameters(shared.bias);
      bundle->AddResidual(
          std::make_unique<DifferenceCost>(kBiasWalk * std::sqrt(seconds), 1.0),
          nullptr, {}, {bias, next});
      bias = next;
      seconds = 0.0;
    }
    seconds += factor.motion2->dt_s;
    bundle->AddVelocityTerm(
        factor.Cost(sigma_factor * noise), factor.images,
        {gravity, bias, unit,
         has_lengths ? bundle->ExtrinsicRotation(*drive) : held_turn});
  }
  if (!has_lengths) {
    bundle->CeresProblem()->SetParameterBlockConstant(held_turn);
  }
  return {noise, unit};
}

}  // namespace adasfm
