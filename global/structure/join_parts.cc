// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/join_parts.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// As required of the matches of a verified pair.
constexpr int kMinNumPoints = 15;
constexpr size_t kMaxNumSamples = 2000;
// In max_angle_rad: the rotation to begin with is wrong by a degree or two.
constexpr double kStartBound = 4.0;
// Median of a chi-square with two degrees of freedom.
constexpr double kMedianOfTwo = 1.386;
constexpr double kMinVariance = 1e-18;
// Least increase of chi-square at a wrong scale: five sigmas.
constexpr double kMinWorse = 25.0;
constexpr int kNumIterations = 30;

// Of rotation (in the world of a), translation and log(scale).
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Matrix37 = Eigen::Matrix<double, 3, 7>;

// sin of the angle between the ray and the point that the camera should see,
// as ray x (point - center) / |point - center|, in the world of a.
struct Residual {
  Eigen::Vector3d value;
  Matrix37 jacobian;  // the distance is held
  bool is_in_front = false;
};

Residual ComputeResidual(const SightAcross& sight, const Sim3d& a_from_b) {
  const Eigen::Vector3d turned =  // part b's contribution
      a_from_b.scale *
      (a_from_b.rotation * (sight.is_point_of_a ? sight.center : sight.point));
  const double sign = sight.is_point_of_a ? -1.0 : 1.0;
  const Eigen::Vector3d to_point =
      sign * (turned + a_from_b.translation -
              (sight.is_point_of_a ? sight.point : sight.center));
  const double distance = std::max(to_point.norm(), 1e-12);
  const Eigen::Vector3d ray =
      sight.is_point_of_a ? a_from_b.rotation * sight.ray : sight.ray;
  Residual residual;
  residual.value = ray.cross(to_point) / distance;
  residual.is_in_front = ray.dot(to_point) > 0.0;
  const Eigen::Matrix3d across = sign / distance * Hat(ray);
  residual.jacobian << across * -Hat(turned), across, across * turned;
  if (sight.is_point_of_a) {
    // (turn x ray) x to_point
    residual.jacobian.leftCols<3>() += Hat(to_point / distance) * Hat(ray);
  }
  return residual;
}

class PartJoiner {
 public:
  PartJoiner(const std::vector<SightAcross>& sights,
             const Eigen::Quaterniond& rotation)
      : sights_(sights) {
    a_from_b_.rotation = rotation;
    weights_.assign(sights.size(), 1.0);
  }

  // Place and scale by two sights at a time, with the rotation held; the best
  // have the least sum of errors, each bounded.
  bool Start() {
    const size_t n = sights_.size();
    const size_t stride = 1 + n * (n - 1) / 2 / kMaxNumSamples;
    double least = std::numeric_limits<double>::infinity();
    size_t count = 0;
    Sim3d best;
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = i + 1; j < n; ++j) {
        if (++count % stride != 0) continue;
        if (sights_[i].point_id == sights_[j].point_id ||
            !SolveWithRotation(sights_[i], sights_[j])) {
          continue;
        }
        const double sum = SumOfBoundedErrors();
        if (sum >= least) continue;
        least = sum;
        best = a_from_b_;
      }
    }
    if (!std::isfinite(least)) return false;
    a_from_b_ = best;
    Reweight();
    return true;
  }

  bool Solve() {
    return Iterate(false) && IsWorseAtOtherSize(2.0) && IsWorseAtOtherSize(0.5);
  }

  std::optional<PartJoin> Finish() const {
    Matrix7 hessian = Matrix7::Zero();
    std::map<int, Vector7> gradients;
    std::set<int> points;
    PartJoin join;
    for (size_t k = 0; k < sights_.size(); ++k) {
      const Residual residual = ComputeResidual(sights_[k], a_from_b_);
      hessian +=
          weights_[k] * residual.jacobian.transpose() * residual.jacobian;
      gradients.emplace(sights_[k].point_id, Vector7::Zero()).first->second +=
          weights_[k] * residual.jacobian.transpose() * residual.value;
      const double max_sine = std::sin(sights_[k].max_angle_rad);
      if (weights_[k] < 0.5 || residual.value.norm() > max_sine) continue;
      ++join.num_sights;
      points.insert(sights_[k].point_id);
    }
    join.num_points = static_cast<int>(points.size());
    if (join.num_points < kMinNumPoints ||
        2 * join.num_sights < static_cast<int>(sights_.size())) {
      return std::nullopt;
    }
    const Vector7 size = hessian.ldlt().solve(Vector7::Unit(6));
    double variance = 0.0;
    for (const auto& [point, gradient] : gradients) {
      const double influence = size.dot(gradient);
      variance += influence * influence;
    }
    const double n = join.num_points;
    join.log_scale_sigma = std::sqrt(variance * n / (n - 7.0));
    join.a_from_b = a_from_b_;
    if (!std::isfinite(join.log_scale_sigma)) return std::nullopt;
    return join;
  }

 private:
  bool Iterate(bool hold_size) {
    for (int i = 0; i < kNumIterations; ++i) {
      Matrix7 hessian = Matrix7::Zero();
      Vector7 gradient = Vector7::Zero();
      for (size_t k = 0; k < sights_.size(); ++k) {
        const Residual residual = ComputeResidual(sights_[k], a_from_b_);
        hessian +=
            weights_[k] * residual.jacobian.transpose() * residual.jacobian;
        gradient +=
            weights_[k] * residual.jacobian.transpose() * residual.value;
      }
      if (hold_size) {
        hessian.row(6).setZero();
        hessian.col(6).setZero();
        hessian(6, 6) = 1.0;
        gradient[6] = 0.0;
      }
      const Vector7 step = -hessian.ldlt().solve(gradient);
      if (!step.allFinite()) return false;
      a_from_b_.rotation =
          (ExpSo3(step.head<3>()) * a_from_b_.rotation).normalized();
      a_from_b_.translation += step.segment<3>(3);
      a_from_b_.scale *= std::exp(std::clamp(step[6], -0.2, 0.2));
      Reweight();
    }
    return true;
  }

  // Where cameras rotate on the spot a wrong scale fits as well as the right
  // one, which the covariance at the right one does not show.
  bool IsWorseAtOtherSize(double factor) const {
    PartJoiner other = *this;
    other.a_from_b_.scale *= factor;
    if (!other.Iterate(true)) return true;
    double difference = 0.0;
    for (const SightAcross& sight : sights_) {
      difference +=
          std::log1p(
              ComputeResidual(sight, other.a_from_b_).value.squaredNorm() /
              bound_) -
          std::log1p(ComputeResidual(sight, a_from_b_).value.squaredNorm() /
                     bound_);
    }
    return bound_ * difference > kMinWorse * variance_;
  }

  // ray x (s R x_b + t) = ray x x_a
  bool SolveWithRotation(const SightAcross& sight1, const SightAcross& sight2) {
    Eigen::Matrix<double, 6, 4> rows;
    Eigen::Matrix<double, 6, 1> right;
    int row = 0;
    for (const SightAcross* sight : {&sight1, &sight2}) {
      const bool of_a = sight->is_point_of_a;
      const Eigen::Matrix3d cross =
          Hat(of_a ? a_from_b_.rotation * sight->ray : sight->ray);
      rows.middleRows<3>(row) << cross,
          cross * (a_from_b_.rotation * (of_a ? sight->center : sight->point));
      right.segment<3>(row) = cross * (of_a ? sight->point : sight->center);
      row += 3;
    }
    const Eigen::Vector4d solution =
        (rows.transpose() * rows).ldlt().solve(rows.transpose() * right);
    if (!solution.allFinite() || solution[3] <= 0.0) return false;
    a_from_b_.translation = solution.head<3>();
    a_from_b_.scale = solution[3];
    return true;
  }

  double SumOfBoundedErrors() const {
    double sum = 0.0;
    for (const SightAcross& sight : sights_) {
      const Residual residual = ComputeResidual(sight, a_from_b_);
      const double bound = kStartBound * sight.max_angle_rad;
      sum += residual.is_in_front
                 ? std::min(1.0, residual.value.squaredNorm() / (bound * bound))
                 : 1.0;
    }
    return sum;
  }

  void Reweight() {
    std::vector<double> squares, sizes;
    for (const SightAcross& sight : sights_) {
      const Residual residual = ComputeResidual(sight, a_from_b_);
      squares.push_back(residual.is_in_front
                            ? residual.value.squaredNorm()
                            : std::numeric_limits<double>::infinity());
    }
    sizes = squares;
    variance_ =
        std::clamp(UpperMedian(&sizes) / kMedianOfTwo, kMinVariance, 1.0);
    bound_ = 4.0 * kMedianOfTwo * variance_;
    for (size_t k = 0; k < sights_.size(); ++k) {
      weights_[k] = 1.0 / (1.0 + squares[k] / bound_);
    }
  }

  const std::vector<SightAcross>& sights_;
  std::vector<double> weights_;
  Sim3d a_from_b_;
  double variance_ = 1.0;  // of an error's component
  double bound_ = 1.0;     // squared error at which weights are halved
};

}  // namespace

std::optional<PartJoin> EstimatePartJoin(
    const std::vector<SightAcross>& sights,
    const Eigen::Quaterniond& a_from_b_rotation) {
  if (sights.size() < kMinNumPoints) return std::nullopt;
  PartJoiner joiner(sights, a_from_b_rotation);
  if (!joiner.Start() || !joiner.Solve()) return std::nullopt;
  return joiner.Finish();
}

}  // namespace adasfm
