// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/seen_wheel_yaw.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/median.h"
#include "core/so3.h"
#include "sensors/rotation_triples.h"
#include "sensors/smoother/chain_state.h"
#include "sensors/timed_rotations.h"

namespace adasfm {
namespace {

constexpr size_t kMinNumSeenLinks = 20;
constexpr double kMaxSlipRatio = 0.2;
// The median of a normal variable's absolute value.
constexpr double kMedianAbs = 0.6745;
// Of the Cauchy loss, in scales of the residuals.
constexpr double kLossScale = 2.0;
// Least scatter of two-view rotations, rad.
constexpr double kMinScale = 1e-6;
constexpr double kBlockS = 2.0;
constexpr int kNumRounds = 20;
// Factor on the scatter of vision, since vision is used again later.
constexpr double kVisualSigmaFactor = 1.5;

// Yaw of the wheels from one image to a later one, compared with the cameras.
struct VisualYaw {
  size_t first_link = 0;
  double start_s = 0.0;
  // (wheels' yaw, distance), and true (visual) minus wheels' yaw.
  Eigen::Vector2d row = Eigen::Vector2d::Zero();
  double difference_rad = 0.0;
  double yaw_variance = 0.0;
};

// Those over num_links links with wheel yaw and without IMU, in order of time.
std::vector<VisualYaw> FindVisualYaws(
    const std::vector<TimedRotation>& rotations, timestamp_t timeshift_ns,
    const Eigen::Quaterniond& cam_from_imu, const OdometryTimeline& timeline,
    const OdometryFusionProblem& problem, size_t num_links) {
  const Eigen::Vector3d up =
      problem.imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  std::vector<VisualYaw> seen;
  for (const TimedRotation& rotation : rotations) {
    const std::optional<size_t> first =
        FindLinkOfRotation(rotation, timeshift_ns, timeline, num_links);
    if (!first) continue;
    VisualYaw turn;
    turn.first_link = *first;
    turn.start_s =
        SecondsFromNs(timeline.times_ns[*first] - timeline.times_ns.front());
    bool is_by_wheels = true;
    for (size_t k = *first; k < *first + num_links; ++k) {
      const OdometryLink& link = problem.links[k];
      is_by_wheels &= !link.has_imu && link.has_wheel && link.has_wheel_yaw;
      turn.row += Eigen::Vector2d(link.wheel.yaw_rad, link.wheel.distance_m);
      turn.yaw_variance += link.wheel.yaw_variance;
    }
    if (!is_by_wheels) continue;
    turn.difference_rad =
        up.dot(LogSo3(BodyRotation(rotation, cam_from_imu))) - turn.row[0];
    seen.push_back(turn);
  }
  std::sort(seen.begin(), seen.end(),
            [](const VisualYaw& a, const VisualYaw& b) {
              return a.first_link < b.first_link;
            });
  return seen;
}

class WheelYawFit {
 public:
  WheelYawFit(const std::vector<VisualYaw>& turns,
              const OdometryFusionOptions& options)
      : turns_(turns), weights_(turns.size(), 1.0) {
    prior_information_ = ChainGlobals::PriorSigmas(options)
                             .segment<2>(ChainGlobals::kLoggedYaw)
                             .cwiseAbs2()
                             .cwiseInverse();
    // Starts with the weights of m = c = 0: long slips bias unweighted least
    // squares by tens of degrees.
    scale_ = Scale();
    UpdateWeights();
    for (int round = 0; round < kNumRounds; ++round) {
      Solve();
      scale_ = Scale();
      UpdateWeights();
    }
    FindCovariance();
  }

  double scale_rad() const { return scale_; }
  double Residual(const VisualYaw& turn) const {
    return turn.difference_rad - turn.row.dot(unknowns_);
  }
  double Variance(const VisualYaw& turn) const {
    return turn.row.dot(covariance_ * turn.row);
  }

  // In the smoother's parameters 1 / (1 + m) and c / (1 + m).
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
    for (size_t i = 0; i < turns_.size(); ++i) {
      const double weight = weights_[i] / (scale_ * scale_);
      matrix += weight * turns_[i].row * turns_[i].row.transpose();
      sum += weight * turns_[i].row * turns_[i].difference_rad;
    }
    inverse_ = matrix.inverse();
    unknowns_ = inverse_ * sum;
  }

  double Scale() const {
    std::vector<double> errors;
    for (const VisualYaw& turn : turns_) {
      errors.push_back(std::abs(Residual(turn)));
    }
    return std::max(kMinScale, UpperMedian(&errors) / kMedianAbs);
  }

  void UpdateWeights() {
    for (size_t i = 0; i < turns_.size(); ++i) {
      weights_[i] =
          1.0 /
          (1.0 + std::pow(Residual(turns_[i]) / (kLossScale * scale_), 2));
    }
  }

  void FindCovariance() {
    Eigen::Matrix2d scores = Eigen::Matrix2d::Zero();
    Eigen::Vector2d score = Eigen::Vector2d::Zero();
    double noise = 0.0;
    int num_blocks = 0;
    for (size_t i = 0; i < turns_.size(); ++i) {
      const double weight = weights_[i] / (scale_ * scale_);
      score += weight * Residual(turns_[i]) * turns_[i].row;
      noise += weight * turns_[i].yaw_variance;
      const bool is_last = i + 1 == turns_.size();
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
    return static_cast<int>(turns_[i].start_s / kBlockS);
  }

  const std::vector<VisualYaw>& turns_;
  std::vector<double> weights_;
  Eigen::Vector2d prior_information_;
  double scale_ = 1.0;
  Eigen::Matrix2d inverse_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d unknowns_ = Eigen::Vector2d::Zero();  // m, c
  Eigen::Matrix2d covariance_ = Eigen::Matrix2d::Zero();
};

// Unseen wheels slip as often as seen ones: adds the mean square, over all seen
// links, of the yaw errors of slips to the variance of unseen links.
void AddUnseenSlips(const std::vector<VisualYaw>& seen,
                    const std::set<size_t>& slips, const WheelYawFit& fit,
                    OdometryFusionProblem* problem) {
  double sum = 0.0;
  std::set<size_t> seen_links;
  for (const VisualYaw& turn : seen) {
    seen_links.insert(turn.first_link);
    if (slips.count(turn.first_link)) sum += std::pow(fit.Residual(turn), 2);
  }
  const double variance = sum / seen.size();
  for (size_t k = 0; k < problem->links.size(); ++k) {
    OdometryLink& link = problem->links[k];
    if (link.has_imu || !link.has_wheel_yaw || seen_links.count(k)) continue;
    link.wheel.yaw_variance += variance;
    // The direction of the path errs by half of the yaw error on average.
    link.wheel.covariance += 0.25 * variance * link.wheel.distance_m *
                             link.wheel.distance_m *
                             Eigen::Matrix3d::Identity();
  }
}

// Links without IMU and wheels get the two-view rotation where those of three
// images agree.
void TakeVisualRotations(const std::vector<TimedRotation>& rotations,
                         timestamp_t timeshift_ns,
                         const Eigen::Quaterniond& cam_from_imu,
                         const OdometryTimeline& timeline, double scale_rad,
                         OdometryFusionProblem* problem) {
  const RotationTriples triples(rotations);
  // The loop has the errors of three rotations.
  const double max_angle_rad = kSlipThresholdSigma * std::sqrt(3.0) * scale_rad;
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
  const auto find_turns = [&](size_t num_links) {
    return FindVisualYaws(rotations, timeshift_ns, cam_from_imu, timeline,
                          *problem, num_links);
  };
  const std::vector<VisualYaw> seen = find_turns(1);
  if (seen.size() < kMinNumSeenLinks) return 0;
  const WheelYawFit fit(seen, options);
  problem->wheel_yaw_prior = fit.Prior();
  const auto differs = [&](const VisualYaw& turn) {
    const double variance =
        std::max(fit.scale_rad() * fit.scale_rad(), turn.yaw_variance) +
        fit.Variance(turn);
    return std::abs(fit.Residual(turn)) >
           kSlipThresholdSigma * std::sqrt(variance);
  };
  std::set<size_t> slips;
  for (const VisualYaw& turn : seen) {
    if (differs(turn)) slips.insert(turn.first_link);
  }
  // The image between two links may have only wrong pairs.
  for (const VisualYaw& turn : find_turns(2)) {
    if (differs(turn)) continue;
    slips.erase(turn.first_link);
    slips.erase(turn.first_link + 1);
  }
  if (slips.size() > kMaxSlipRatio * seen.size()) slips.clear();
  for (const size_t k : slips) {
    problem->links[k].has_wheel = false;
    problem->links[k].has_wheel_yaw = false;
  }
  AddUnseenSlips(seen, slips, fit, problem);
  TakeVisualRotations(rotations, timeshift_ns, cam_from_imu, timeline,
                      fit.scale_rad(), problem);
  return static_cast<int>(slips.size());
}

}  // namespace adasfm
