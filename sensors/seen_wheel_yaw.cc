// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/seen_wheel_yaw.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/median.h"
#include "core/so3.h"
#include "sensors/rotation_triples.h"
#include "sensors/smoother/chain_state.h"
#include "sensors/visual_links.h"

namespace adasfm {
namespace {

constexpr size_t kMinNumSeenLinks = 20;
constexpr double kMaxSlipRatio = 0.2;
// The median of a normal variable's absolute value.
constexpr double kMedianAbs = 0.6745;
// In scales of the residuals.
constexpr double kLossScale = 2.0;
// No scatter of two-view rotations is smaller, rad.
constexpr double kMinScale = 1e-6;
constexpr double kBlockS = 2.0;
constexpr int kNumRounds = 20;
// Vision is taken for half as much again as it scatters: it is used again.
constexpr double kVisualSigmaFactor = 1.5;

struct SeenLink {
  size_t index = 0;
  double start_s = 0.0;
  // (wheels' yaw, distance), and true minus wheels' yaw.
  Eigen::Vector2d row = Eigen::Vector2d::Zero();
  double difference_rad = 0.0;
  double yaw_variance = 0.0;
};

std::vector<SeenLink> FindSeenLinks(const std::vector<TimedRotation>& rotations,
                                    timestamp_t timeshift_ns,
                                    const Eigen::Quaterniond& cam_from_imu,
                                    const OdometryTimeline& timeline,
                                    const OdometryFusionProblem& problem) {
  const Eigen::Vector3d up =
      problem.imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  std::vector<SeenLink> seen;
  for (const TimedRotation& rotation : rotations) {
    const std::optional<size_t> k =
        FindLinkOfRotation(rotation, timeshift_ns, timeline);
    if (!k) continue;
    const OdometryLink& link = problem.links[*k];
    if (link.has_imu || !link.has_wheel || !link.has_wheel_yaw) continue;
    SeenLink entry;
    entry.index = *k;
    entry.start_s =
        SecondsFromNs(timeline.times_ns[*k] - timeline.times_ns.front());
    entry.row << link.wheel.yaw_rad, link.wheel.distance_m;
    entry.difference_rad =
        up.dot(LogSo3(BodyRotation(rotation, cam_from_imu))) -
        link.wheel.yaw_rad;
    entry.yaw_variance = link.wheel.yaw_variance;
    seen.push_back(entry);
  }
  std::sort(seen.begin(), seen.end(), [](const SeenLink& a, const SeenLink& b) {
    return a.index < b.index;
  });
  return seen;
}

class WheelYawFit {
 public:
  WheelYawFit(const std::vector<SeenLink>& links,
              const OdometryFusionOptions& options)
      : links_(links), weights_(links.size(), 1.0) {
    prior_information_ = ChainGlobals::PriorSigmas(options)
                             .segment<2>(ChainGlobals::kLoggedYaw)
                             .cwiseAbs2()
                             .cwiseInverse();
    scale_ = Scale();
    for (int round = 0; round < kNumRounds; ++round) {
      Solve();
      scale_ = Scale();
      UpdateWeights();
    }
    FindCovariance();
  }

  double scale_rad() const { return scale_; }
  double Residual(const SeenLink& link) const {
    return link.difference_rad - link.row.dot(unknowns_);
  }
  double Variance(const SeenLink& link) const {
    return link.row.dot(covariance_ * link.row);
  }

  // As the smoother has them: of 1 / (1 + m) and c / (1 + m).
  WheelYawPrior Prior() const {
    const double logged_per_true = 1.0 / (1.0 + unknowns_[0]);
    WheelYawPrior prior;
    prior.logged_yaw = logged_per_true;
    prior.curvature = unknowns_[1] * logged_per_true;
    const double by_track = -logged_per_true * logged_per_true;
    Eigen::Matrix2d map;
    map << by_track, 0.0, unknowns_[1] * by_track, logged_per_true;
    prior.covariance = map * covariance_ * map.transpose();
    return prior;
  }

 private:
  void Solve() {
    Eigen::Matrix2d matrix = prior_information_.asDiagonal();
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < links_.size(); ++i) {
      const double weight = weights_[i] / (scale_ * scale_);
      matrix += weight * links_[i].row * links_[i].row.transpose();
      sum += weight * links_[i].row * links_[i].difference_rad;
    }
    inverse_ = matrix.inverse();
    unknowns_ = inverse_ * sum;
  }

  double Scale() const {
    std::vector<double> errors;
    for (const SeenLink& link : links_) {
      errors.push_back(std::abs(Residual(link)));
    }
    return std::max(kMinScale, UpperMedian(&errors) / kMedianAbs);
  }

  void UpdateWeights() {
    for (size_t i = 0; i < links_.size(); ++i) {
      weights_[i] =
          1.0 /
          (1.0 + std::pow(Residual(links_[i]) / (kLossScale * scale_), 2));
    }
  }

  void FindCovariance() {
    Eigen::Matrix2d scores = Eigen::Matrix2d::Zero();
    Eigen::Vector2d score = Eigen::Vector2d::Zero();
    double noise = 0.0;
    int num_blocks = 0;
    for (size_t i = 0; i < links_.size(); ++i) {
      const double weight = weights_[i] / (scale_ * scale_);
      score += weight * Residual(links_[i]) * links_[i].row;
      noise += weight * links_[i].yaw_variance;
      const bool is_last = i + 1 == links_.size();
      if (!is_last && Block(i + 1) == Block(i)) continue;
      scores += score * score.transpose();
      score.setZero();
      ++num_blocks;
    }
    scores *= num_blocks / std::max(1.0, num_blocks - 2.0);
    scores += prior_information_.asDiagonal();
    covariance_ = inverse_ * scores * inverse_;
    covariance_(0, 0) += std::pow(noise * inverse_(0, 0), 2);
  }

  int Block(size_t i) const {
    return static_cast<int>(links_[i].start_s / kBlockS);
  }

  const std::vector<SeenLink>& links_;
  std::vector<double> weights_;
  Eigen::Vector2d prior_information_;
  double scale_ = 1.0;
  Eigen::Matrix2d inverse_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d unknowns_ = Eigen::Vector2d::Zero();  // m, c
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();
};

// Links that only cameras see turn as those of three images agree they do.
void TakeVisualRotations(const std::vector<TimedRotation>& rotations,
                         timestamp_t timeshift_ns,
                         const Eigen::Quaterniond& cam_from_imu,
                         const OdometryTimeline& timeline, double scale_rad,
                         double threshold_sigma,
                         OdometryFusionProblem* problem) {
  const RotationTriples triples(rotations);
  // Of three rotations.
  const double max_angle_rad = threshold_sigma * std::sqrt(3.0) * scale_rad;
  for (const TimedRotation& rotation : rotations) {
    const std::optional<size_t> k =
        FindLinkOfRotation(rotation, timeshift_ns, timeline);
    if (!k) continue;
    OdometryLink& link = problem->links[*k];
    if (link.has_imu || link.has_wheel ||
        !triples.Closes(rotation, max_angle_rad)) {
      continue;
    }
    link.has_vision = true;
    link.visual_rotation = BodyRotation(rotation, cam_from_imu);
    link.visual_sigma_rad = kVisualSigmaFactor * scale_rad;
  }
}

}  // namespace

int UseSeenWheelYaw(const std::vector<TimedRotation>& rotations,
                    timestamp_t timeshift_ns,
                    const Eigen::Quaterniond& cam_from_imu,
                    const OdometryTimeline& timeline,
                    const OdometryFusionOptions& options,
                    OdometryFusionProblem* problem) {
  const std::vector<SeenLink> seen =
      FindSeenLinks(rotations, timeshift_ns, cam_from_imu, timeline, *problem);
  if (seen.size() < kMinNumSeenLinks) return 0;
  const WheelYawFit fit(seen, options);
  problem->wheel_yaw_prior = fit.Prior();
  std::vector<size_t> slips;
  for (const SeenLink& link : seen) {
    const double variance =
        std::max(fit.scale_rad() * fit.scale_rad(), link.yaw_variance) +
        fit.Variance(link);
    if (std::abs(fit.Residual(link)) >
        options.slip_threshold_sigma * std::sqrt(variance)) {
      slips.push_back(link.index);
    }
  }
  if (slips.size() > kMaxSlipRatio * seen.size()) slips.clear();
  for (const size_t k : slips) {
    problem->links[k].has_wheel = false;
    problem->links[k].has_wheel_yaw = false;
  }
  TakeVisualRotations(rotations, timeshift_ns, cam_from_imu, timeline,
                      fit.scale_rad(), options.slip_threshold_sigma, problem);
  return static_cast<int>(slips.size());
}

}  // namespace adasfm
