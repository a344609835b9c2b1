// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/correct_camera_mount.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "global/calibration/mount_observations.h"

namespace adasfm {
namespace {

using Unknowns = Eigen::Matrix<double, kNumMountUnknowns, 1>;
using Information = Eigen::Matrix<double, kNumMountUnknowns, kNumMountUnknowns>;
// The turns of the mount and of the direction of driving.
constexpr int kNumTurns = kRateUnknown;
using Turns = Eigen::Matrix<double, kNumTurns, 1>;
using TurnCovariance = Eigen::Matrix<double, kNumTurns, kNumTurns>;

// Fewer spans of the drive do not tell how they vary.
constexpr int kMinNumSpans = 5;
// 1 sigma of the other unknowns: the direction of driving as the odometry
// chain grants it, what may be left of a gyroscope's bias, and what all
// two-view rotations are wrong by alike.
constexpr double kDrivingDirectionSigmaRad = 0.01;
constexpr double kRateSigmaRadS = 1e-3;
constexpr double kOffsetSigmaRad = 2e-3;

std::vector<MountObservation> Observe(const CameraMountOptions& options,
                                      const OdometryChain& chain,
                                      const std::vector<MountPair>& pairs,
                                      const Eigen::Quaterniond& turn) {
  std::vector<std::vector<MountObservation>> by_pair(pairs.size());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t k) {
    by_pair[k] = ObserveMount(chain, turn, pairs[k]);
  });
  std::vector<MountObservation> observations;
  for (const std::vector<MountObservation>& of_pair : by_pair) {
    for (const MountObservation& observation : of_pair) {
      if (observation.jacobian.allFinite() &&
          observation.residual.allFinite()) {
        observations.push_back(observation);
      }
    }
  }
  return observations;
}

double HuberWeight(const MountObservation& observation,
                   const Unknowns& unknowns) {
  constexpr double kHuberSigmas = 1.5;
  const double sigmas =
      (observation.residual - observation.jacobian * unknowns).norm();
  return observation.weight *
         std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-9));
}

struct MountSolution {
  // Further turn of the mount, and the rest.
  Unknowns unknowns = Unknowns::Zero();
  TurnCovariance covariance = TurnCovariance::Zero();
  double residual_variance = 0.0;
  bool observes_directions = false;
  bool success = false;
};

// 1 sigma of the unknowns before any data.
Unknowns PriorSigmas(const CameraMountOptions& options) {
  Unknowns sigmas;
  sigmas << Eigen::Vector3d::Constant(DegToRad(options.sigma_deg)),
      Eigen::Vector3d::Constant(kDrivingDirectionSigmaRad),
      Eigen::Vector3d::Constant(kRateSigmaRadS),
      Eigen::Vector3d::Constant(kOffsetSigmaRad);
  return sigmas;
}

// What the observations vary by from span to span, on top of their own
// covariance: pairs of one span share what moves, what is planar, how the
// machine pitches.
TurnCovariance SpreadOfSpans(const std::vector<MountObservation>& observations,
                             const MountSolution& solution,
                             const Information& covariance) {
  std::map<int, Unknowns> gradients;
  for (const MountObservation& observation : observations) {
    gradients.emplace(observation.span, Unknowns::Zero()).first->second +=
        HuberWeight(observation, solution.unknowns) *
        observation.jacobian.transpose() *
        (observation.residual - observation.jacobian * solution.unknowns);
  }
  Information spread = Information::Zero();
  for (const auto& [span, gradient] : gradients) {
    spread += gradient * gradient.transpose();
  }
  return (covariance * spread * covariance)
      .topLeftCorner<kNumTurns, kNumTurns>();
}

// Squared residuals per degree of freedom, 1 when chain and matches are as
// noisy as they say; single wrong pairs do not speak for all.
double ResidualVariance(const std::vector<MountObservation>& observations,
                        const MountSolution& solution) {
  constexpr double kMaxTerm = 25.0;
  double sum = 0.0;
  for (const MountObservation& observation : observations) {
    const double squared =
        (observation.residual - observation.jacobian * solution.unknowns)
            .squaredNorm();
    sum += std::min(kMaxTerm, squared / observation.num_dof);
  }
  return sum / std::max<size_t>(1, observations.size());
}

MountSolution Solve(const CameraMountOptions& options,
                    const std::vector<MountObservation>& observations,
                    const Eigen::Vector3d& turn_rad) {
  constexpr int kNumIterations = 8;
  const Information prior =
      PriorSigmas(options).cwiseAbs2().cwiseInverse().asDiagonal();
  // The prior is of the whole turn.
  Unknowns known = Unknowns::Zero();
  known.head<3>() = -turn_rad;
  MountSolution solution;
  Information information;
  for (int k = 0; k < kNumIterations; ++k) {
    information = prior;
    Unknowns right_side = prior * known;
    for (const MountObservation& observation : observations) {
      const Eigen::Matrix<double, kNumMountUnknowns, 3> weighted =
          HuberWeight(observation, solution.unknowns) *
          observation.jacobian.transpose();
      information.noalias() += weighted * observation.jacobian;
      right_side.noalias() += weighted * observation.residual;
    }
    solution.unknowns = information.ldlt().solve(right_side);
  }
  const Information covariance = information.inverse();
  solution.residual_variance = ResidualVariance(observations, solution);
  solution.covariance = std::max(1.0, solution.residual_variance) *
                        (covariance.topLeftCorner<kNumTurns, kNumTurns>() +
                         SpreadOfSpans(observations, solution, covariance));
  solution.observes_directions = std::any_of(
      observations.begin(), observations.end(),
      [](const MountObservation& observation) {
        return !observation.jacobian.middleCols<3>(kDrivingDirectionUnknown)
                    .isZero();
      });
  solution.success =
      solution.unknowns.allFinite() && solution.covariance.allFinite();
  return solution;
}

int CountSpans(const std::vector<MountPair>& pairs) {
  std::map<int, int> spans;
  for (const MountPair& pair : pairs) ++spans[pair.span];
  return spans.size();
}

// What of the mount's turn stands out of its noise, axis by axis. In units of
// what is believed before any data, what the data cannot tell apart (a turn of
// the mount from one of the direction of driving) has no value of its own.
Eigen::Vector3d KeepKnown(const CameraMountOptions& options, const Turns& turns,
                          const TurnCovariance& covariance) {
  constexpr double kNumSigmas = 2.0;
  const Turns sigmas = PriorSigmas(options).head<kNumTurns>();
  const auto inverse = sigmas.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<TurnCovariance> eigen(
      TurnCovariance(inverse * covariance * inverse));
  Turns along = eigen.eigenvectors().transpose() * (inverse * turns);
  for (int k = 0; k < kNumTurns; ++k) {
    if (std::abs(along(k)) < kNumSigmas * std::sqrt(eigen.eigenvalues()(k))) {
      along(k) = 0.0;
    }
  }
  return (sigmas.asDiagonal() * (eigen.eigenvectors() * along)).head<3>();
}

// As the chain has them: directions of motion show the mount's turn and that of
// the direction of driving together.
SharedTurns ToSharedTurns(const Turns& turns,
                          const TurnCovariance& covariance) {
  TurnCovariance shared_from_turns = TurnCovariance::Identity();
  shared_from_turns.bottomLeftCorner<3, 3>().setIdentity();
  const Turns shared = shared_from_turns * turns;
  return {shared.head<3>(), shared.tail<3>(),
          shared_from_turns * covariance * shared_from_turns.transpose()};
}

}  // namespace

bool CameraMountOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .AtLeast(1, "max_num_steps", max_num_steps)
      .Positive({{"sigma_deg", sigma_deg}, {"min_sigma_deg", min_sigma_deg}})
      .NotNegative({{"min_num_sigmas", min_num_sigmas}})
      .AllHold();
}

void TurnPrior(const Eigen::Quaterniond& turned_from_cam,
               RelativePosePrior* prior) {
  Rigid3d& motion = prior->cam2_from_cam1;
  motion.rotation =
      (turned_from_cam * motion.rotation * turned_from_cam.conjugate())
          .normalized();
  motion.translation = turned_from_cam * motion.translation;
  const Eigen::Matrix3d matrix = turned_from_cam.toRotationMatrix();
  for (int row = 0; row < 6; row += 3) {
    for (int col = 0; col < 6; col += 3) {
      auto block = prior->covariance.block<3, 3>(row, col);
      // What is not observed is so in all directions.
      if (!block.allFinite()) continue;
      block = (matrix * block * matrix.transpose()).eval();
    }
  }
}

CameraMountReport CorrectCameraMount(
    const CameraMountOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const GlobalCorrespondences& correspondences,
    std::vector<RelativePosePrior>* priors) {
  constexpr int kNumRounds = 4;
  constexpr double kSmallTurnRad = 1e-4;
  CameraMountReport report;
  const std::vector<MountPair> pairs = CollectMountPairs(
      options.max_num_steps, chain, graph, correspondences, *priors);
  report.num_pairs = pairs.size();
  if (!options.enabled || CountSpans(pairs) < kMinNumSpans) return report;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  MountSolution solution;
  for (int round = 0; round < kNumRounds; ++round) {
    solution =
        Solve(options, Observe(options, chain, pairs, turn), LogSo3(turn));
    if (!solution.success) return report;
    turn = ExpSo3(solution.unknowns.head<3>()) * turn;
    if (solution.unknowns.head<3>().norm() < kSmallTurnRad) break;
  }
  report.turn_rad = LogSo3(turn);
  report.residual_variance = solution.residual_variance;
  const double floor_rad = DegToRad(options.min_sigma_deg);
  const TurnCovariance covariance =
      solution.covariance + floor_rad * floor_rad * TurnCovariance::Identity();
  Turns turns = solution.unknowns.head<kNumTurns>();
  turns.head<3>() = report.turn_rad;
  report.chi2 = turns.dot(covariance.ldlt().solve(turns));
  const Eigen::Vector3d axis = report.turn_rad.normalized();
  report.sigma_rad =
      std::sqrt(axis.dot(covariance.topLeftCorner<3, 3>() * axis));
  const Eigen::Vector3d known = KeepKnown(options, turns, covariance);
  if (solution.observes_directions) {
    report.left_in_priors = ToSharedTurns(turns, covariance);
  }
  // Where the mount's share is below what stands out of the floor, the finding
  // is the direction of driving, which the adjustments have an unknown for.
  if (report.chi2 < options.min_num_sigmas * options.min_num_sigmas ||
      known.norm() < options.min_num_sigmas * floor_rad) {
    return report;
  }
  report.turn_rad = known;
  report.corrected = true;
  if (report.left_in_priors) {
    report.left_in_priors->mount_rad -= known;
    report.left_in_priors->driving_direction_rad -= known;
  }
  for (RelativePosePrior& prior : *priors) {
    TurnPrior(ExpSo3(report.turn_rad), &prior);
  }
  return report;
}

}  // namespace adasfm
