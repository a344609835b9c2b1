// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/align_to_positions.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr int kMinNumPositions = 3;
constexpr int kNumHypotheses = 600;
constexpr uint64_t kSeed = 17;
// Sigmas of a direction that a normal error hardly exceeds.
constexpr double kNormalSigmas = 4.0;
// Tried thresholds, as shares of the positions' extent: possible deformations
// of a coarse model.
constexpr double kBendRatios[] = {0.0, 0.01, 0.03, 0.1};
constexpr double kMinInlierRatio = 0.6;
// 1 sigma of the vertical from an IMU, and from how photographers hold cameras.
constexpr double kGravitySigmaRad = DegToRad(1.0);
constexpr double kUprightSigmaRad = DegToRad(20.0);
constexpr double kMaxCostRatioOfAny = 0.7;
constexpr double kMaxHeadingSigmaRad = DegToRad(5.0);
constexpr double kMaxScaleSigma = 0.1;
// Residual at which Tukey's weight becomes 0, in thresholds.
constexpr double kTukeyRatio = 1.5;
constexpr int kNumIterations = 20;

// p = s R c + t + R l, with the camera centre c in the world's unit and the
// antenna's offset l in metres along the world's axes.
struct Observation {
  Eigen::Vector3d center;
  Eigen::Vector3d lever;
  Eigen::Vector3d position;
  double sigma = 1.0;
};

class Aligner {
 public:
  explicit Aligner(const PositionAlignmentInput& input) : input_(input) {
    for (const PositionPrior& prior : input.positions) AddObservation(prior);
    result_.num_positions = static_cast<int>(observations_.size());
    has_gravity_ = input.down_in_world.has_value();
    down_ = has_gravity_ ? *input.down_in_world : MeanCameraDown();
  }

  PositionAlignment Run() {
    if (result_.num_positions < kMinNumPositions) {
      return Fail("only " + std::to_string(result_.num_positions) +
                  " positions belong to images of the model");
    }
    median_sigma_ = MedianSigma();
    DrawHypotheses();
    const double extent = Extent();
    for (const double ratio : kBendRatios) {
      threshold_ = std::max(kNormalSigmas * median_sigma_, ratio * extent);
      const std::optional<Sim3d> best = FindBest();
      if (!best.has_value()) continue;
      Sim3d refined = *best;
      if (!Refine(&refined)) continue;
      result_.num_inliers = CountInliers(refined);
      if (result_.num_inliers <
          std::max<int>(kMinNumPositions,
                        std::ceil(kMinInlierRatio * result_.num_positions))) {
        continue;
      }
      return Conclude(refined);
    }
    return Fail(
        "the way of the images and that of the positions have different "
        "shapes (clocks, swapped columns, or a log of another drive)");
  }

 private:
  PositionAlignment Fail(const std::string& why) {
    result_.failure = why;
    return result_;
  }

  PositionAlignment Conclude(const Sim3d& enu_from_world) {
    if (!(heading_sigma_ <= kMaxHeadingSigmaRad)) {
      return Fail("the positions lie too close together to tell the heading");
    }
    if (!input_.is_metric && !(scale_sigma_ <= kMaxScaleSigma)) {
      return Fail("the positions lie too close together to tell the scale");
    }
    result_.enu_from_world = enu_from_world;
    result_.threshold_sigmas = threshold_ / median_sigma_;
    result_.success = true;
    return result_;
  }

  void AddObservation(const PositionPrior& prior) {
    const auto first = input_.cams_from_world.find(prior.image_id1);
    const auto second = input_.cams_from_world.find(prior.image_id2);
    if (first == input_.cams_from_world.end() ||
        second == input_.cams_from_world.end()) {
      return;
    }
    const Rigid3d& pose1 = first->second;
    const Rigid3d& pose2 = second->second;
    Observation observation;
    observation.center = (1.0 - prior.share) * pose1.TargetOriginInSource() +
                         prior.share * pose2.TargetOriginInSource();
    observation.lever =
        (1.0 - prior.share) *
            (pose1.rotation.conjugate() * prior.antenna_in_cam) +
        prior.share * (pose2.rotation.conjugate() * prior.antenna_in_cam);
    observation.position = prior.position;
    observation.sigma = PositionSigma(prior);
    observations_.push_back(observation);
  }

  Eigen::Vector3d MeanCameraDown() const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [image_id, pose] : input_.cams_from_world) {
      sum += pose.rotation.conjugate() * Eigen::Vector3d::UnitY();
    }
    return sum.norm() > 1e-9 ? sum.normalized() : Eigen::Vector3d::UnitY();
  }

  double MedianSigma() const {
    std::vector<double> sigmas;
    for (const Observation& o : observations_) sigmas.push_back(o.sigma);
    return Median(std::move(sigmas));
  }

  // The extent of the middle four fifths of the positions, to exclude jumps.
  double Extent() const {
    Eigen::Vector3d size;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (const Observation& o : observations_) {
        values.push_back(o.position(axis));
      }
      std::sort(values.begin(), values.end());
      size(axis) = values[values.size() * 9 / 10] - values[values.size() / 10];
    }
    return size.norm();
  }

  void DrawHypotheses() {
    Random random(kSeed);
    for (int k = 0; k < kNumHypotheses; ++k) {
      const std::vector<int> sample = random.Sample(3, result_.num_positions);
      Sim3d hypothesis;
      if (FromPair(observations_[sample[0]], observations_[sample[1]],
                   &hypothesis)) {
        upright_.push_back(hypothesis);
      }
      if (!has_gravity_ && FromTriple(sample, &hypothesis)) {
        any_.push_back(hypothesis);
      }
    }
  }

  bool FromPair(const Observation& a, const Observation& b,
                Sim3d* enu_from_world) const {
    const Eigen::Quaterniond level =
        Eigen::Quaterniond::FromTwoVectors(down_, -Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d target = b.position - a.position;
    Eigen::Vector3d source = level * (b.center - a.center);
    double scale = 1.0;
    if (input_.is_metric) {
      source += level * (b.lever - a.lever);
    } else {
      if (!(source.norm() > 0.0)) return false;
      scale = target.norm() / source.norm();
    }
    if (!(scale > 0.0) || !(source.head<2>().norm() > 0.0) ||
        !(target.head<2>().norm() > 0.0)) {
      return false;
    }
    const double yaw =
        std::atan2(target.y(), target.x()) - std::atan2(source.y(), source.x());
    const Eigen::Quaterniond rotation =
        Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * level;
    *enu_from_world = Sim3d(
        scale, rotation,
        0.5 * (a.position + b.position -
               rotation * (scale * (a.center + b.center) + a.lever + b.lever)));
    return true;
  }

  bool FromTriple(const std::vector<int>& sample, Sim3d* enu_from_world) const {
    std::vector<Eigen::Vector3d> source, target;
    for (const int i : sample) {
      source.push_back(observations_[i].center);
      target.push_back(observations_[i].position);
    }
    AlignmentOptions options;
    options.estimate_scale = !input_.is_metric;
    return EstimateSim3d(source, target, options, enu_from_world) &&
           enu_from_world->scale > 0.0;
  }

  static Eigen::Vector3d Residual(const Sim3d& enu_from_world,
                                  const Observation& o) {
    return o.position - enu_from_world * o.center -
           enu_from_world.rotation * o.lever;
  }

  double Threshold(const Observation& o) const {
    return std::max(threshold_, kNormalSigmas * o.sigma);
  }

  std::optional<Sim3d> FindBest() const {
    std::optional<Sim3d> best;
    double least_cost = static_cast<double>(observations_.size());
    FindBetter(upright_, &least_cost, &best);
    // On a straight trajectory three positions leave the roll free: a
    // hypothesis from three positions must fit clearly better.
    least_cost *= kMaxCostRatioOfAny;
    FindBetter(any_, &least_cost, &best);
    return best;
  }

  void FindBetter(const std::vector<Sim3d>& hypotheses, double* least_cost,
                  std::optional<Sim3d>* best) const {
    for (const Sim3d& hypothesis : hypotheses) {
      double cost = 0.0;
      for (const Observation& o : observations_) {
        cost += std::min(
            1.0, (Residual(hypothesis, o) / Threshold(o)).squaredNorm());
        if (cost >= *least_cost) break;
      }
      if (cost >= *least_cost) continue;
      *least_cost = cost;
      *best = hypothesis;
    }
  }

  int CountInliers(const Sim3d& enu_from_world) const {
    return static_cast<int>(std::count_if(
        observations_.begin(), observations_.end(), [&](const auto& o) {
          return Residual(enu_from_world, o).norm() <= Threshold(o);
        }));
  }

  // Parameters: a rotation applied on the left, a shift, and the log of the
  // scale.
  bool Refine(Sim3d* enu_from_world) {
    using Vector7 = Eigen::Matrix<double, 7, 1>;
    Eigen::Matrix<double, 7, 7> hessian;
    for (int iteration = 0; iteration < kNumIterations; ++iteration) {
      hessian.setZero();
      Vector7 gradient = Vector7::Zero();
      for (const Observation& o : observations_) {
        const Eigen::Vector3d residual = Residual(*enu_from_world, o);
        const Eigen::Vector3d scaled =
            enu_from_world->scale * (enu_from_world->rotation * o.center);
        Eigen::Matrix<double, 3, 7> jacobian;
        jacobian << Hat(scaled + enu_from_world->rotation * o.lever),
            -Eigen::Matrix3d::Identity(), -scaled;
        // Tukey's biweight: larger residuals have no weight.
        const double ratio =
            std::min(1.0, residual.norm() / (kTukeyRatio * Threshold(o)));
        const double weight =
            std::pow(1.0 - ratio * ratio, 2) / (o.sigma * o.sigma);
        hessian += weight * jacobian.transpose() * jacobian;
        gradient += weight * jacobian.transpose() * residual;
      }
      AddVertical(*enu_from_world, &hessian, &gradient);
      // The scale is fixed: a unit diagonal keeps its step at zero.
      if (input_.is_metric) {
        hessian.row(6).setZero();
        hessian.col(6).setZero();
        hessian(6, 6) = 1.0;
        gradient(6) = 0.0;
      }
      const Vector7 step = -hessian.ldlt().solve(gradient);
      if (!step.allFinite()) return false;
      enu_from_world->rotation =
          (ExpSo3(step.head<3>()) * enu_from_world->rotation).normalized();
      enu_from_world->translation += step.segment<3>(3);
      enu_from_world->scale *= std::exp(std::clamp(step(6), -1.0, 1.0));
    }
    const Eigen::Matrix<double, 7, 7> covariance =
        hessian.ldlt().solve(Eigen::Matrix<double, 7, 7>::Identity());
    heading_sigma_ = std::sqrt(covariance(2, 2));
    scale_sigma_ = std::sqrt(covariance(6, 6));
    return enu_from_world->scale > 0.0;
  }

  void AddVertical(const Sim3d& enu_from_world,
                   Eigen::Matrix<double, 7, 7>* hessian,
                   Eigen::Matrix<double, 7, 1>* gradient) const {
    const Eigen::Vector3d down = enu_from_world.rotation * down_;
    // Ignores a mean camera axis that the positions contradict (a camera that
    // looks down).
    if (!has_gravity_ && -down.z() < 0.7) return;
    const double sigma = has_gravity_ ? kGravitySigmaRad : kUprightSigmaRad;
    const Eigen::Vector3d residual = down + Eigen::Vector3d::UnitZ();
    const Eigen::Matrix3d jacobian = -Hat(down);
    hessian->topLeftCorner<3, 3>() +=
        jacobian.transpose() * jacobian / (sigma * sigma);
    gradient->head<3>() += jacobian.transpose() * residual / (sigma * sigma);
  }

  const PositionAlignmentInput& input_;
  std::vector<Observation> observations_;
  std::vector<Sim3d> upright_;
  std::vector<Sim3d> any_;
  bool has_gravity_ = false;
  Eigen::Vector3d down_;
  double median_sigma_ = 1.0;
  double threshold_ = 0.0;
  double heading_sigma_ = 0.0;
  double scale_sigma_ = 0.0;
  PositionAlignment result_;
};

}  // namespace

double PositionSigma(const PositionPrior& prior) {
  return std::sqrt(prior.covariance.trace() / 3.0);
}

PositionAlignment AlignToPositions(const PositionAlignmentInput& input) {
  return Aligner(input).Run();
}

}  // namespace adasfm
