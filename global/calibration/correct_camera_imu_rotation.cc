// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/correct_camera_imu_rotation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "global/calibration/extrinsic_observations.h"

namespace adasfm {
namespace {

using Unknowns = Eigen::Matrix<double, kNumExtrinsicUnknowns, 1>;
using Information =
    Eigen::Matrix<double, kNumExtrinsicUnknowns, kNumExtrinsicUnknowns>;
// The errors of the camera-IMU rotation and of the direction of driving.
constexpr int kNumRotationUnknowns = kRateUnknown;
using RotationErrors = Eigen::Matrix<double, kNumRotationUnknowns, 1>;
using RotationCovariance =
    Eigen::Matrix<double, kNumRotationUnknowns, kNumRotationUnknowns>;

// Fewer spans of the drive do not determine the spread between spans.
constexpr int kMinNumSpans = 5;
// 1 sigma of the other unknowns: the direction of driving as in the odometry
// chain, the remaining gyroscope bias, and an error that all two-view rotations
// share.
constexpr double kDrivingDirectionSigmaRad = 0.01;
constexpr double kRateSigmaRadS = 1e-3;
constexpr double kOffsetSigmaRad = 2e-3;

std::vector<ExtrinsicObservation> Observe(
    const CameraImuRotationOptions& options, const OdometryChain& chain,
    const std::vector<ExtrinsicPair>& pairs,
    const Eigen::Quaterniond& rotation) {
  std::vector<std::vector<ExtrinsicObservation>> by_pair(pairs.size());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t k) {
    by_pair[k] = ObserveExtrinsics(chain, rotation, pairs[k]);
  });
  std::vector<ExtrinsicObservation> observations;
  for (const std::vector<ExtrinsicObservation>& of_pair : by_pair) {
    for (const ExtrinsicObservation& observation : of_pair) {
      if (observation.jacobian.allFinite() &&
          observation.residual.allFinite()) {
        observations.push_back(observation);
      }
    }
  }
  return observations;
}

double HuberWeight(const ExtrinsicObservation& observation,
                   const Unknowns& unknowns) {
  constexpr double kHuberSigmas = 1.5;
  const double sigmas =
      (observation.residual - observation.jacobian * unknowns).norm();
  return observation.weight *
         std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-9));
}

struct ExtrinsicSolution {
  // Further error of the rotation, and the other unknowns.
  Unknowns unknowns = Unknowns::Zero();
  RotationCovariance covariance = RotationCovariance::Zero();
  double residual_variance = 0.0;
  bool observes_directions = false;
  bool success = false;
};

// 1 sigma of the unknowns before any data.
Unknowns PriorSigmas(const CameraImuRotationOptions& options) {
  Unknowns sigmas;
  sigmas << Eigen::Vector3d::Constant(DegToRad(options.sigma_deg)),
      Eigen::Vector3d::Constant(kDrivingDirectionSigmaRad),
      Eigen::Vector3d::Constant(kRateSigmaRadS),
      Eigen::Vector3d::Constant(kGyroscopeScaleSigma),
      Eigen::Vector3d::Constant(kOffsetSigmaRad);
  return sigmas;
}

// The spread of the observations from span to span, on top of their own
// covariance: pairs of one span share moving objects, planar scenes and the
// machine's pitch.
RotationCovariance SpreadOfSpans(
    const std::vector<ExtrinsicObservation>& observations,
    const ExtrinsicSolution& solution, const Information& covariance) {
  std::map<int, Unknowns> gradients;
  for (const ExtrinsicObservation& observation : observations) {
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
      .topLeftCorner<kNumRotationUnknowns, kNumRotationUnknowns>();
}

// Squared residuals per degree of freedom, 1 when chain and matches have the
// noise that they state. Terms are bounded, so that single wrong pairs do not
// dominate.
double ResidualVariance(const std::vector<ExtrinsicObservation>& observations,
                        const ExtrinsicSolution& solution) {
  constexpr double kMaxTerm = 25.0;
  double sum = 0.0;
  for (const ExtrinsicObservation& observation : observations) {
    const double squared =
        (observation.residual - observation.jacobian * solution.unknowns)
            .squaredNorm();
    sum += std::min(kMaxTerm, squared / observation.num_dof);
  }
  return sum / std::max<size_t>(1, observations.size());
}

ExtrinsicSolution Solve(const CameraImuRotationOptions& options,
                        const std::vector<ExtrinsicObservation>& observations,
                        const Eigen::Vector3d& rotation_rad) {
  constexpr int kNumIterations = 8;
  const Information prior =
      PriorSigmas(options).cwiseAbs2().cwiseInverse().asDiagonal();
  // The prior applies to the whole rotation, not to its further error alone.
  Unknowns known = Unknowns::Zero();
  known.head<3>() = -rotation_rad;
  ExtrinsicSolution solution;
  Information information;
  for (int k = 0; k < kNumIterations; ++k) {
    information = prior;
    Unknowns right_side = prior * known;
    for (const ExtrinsicObservation& observation : observations) {
      const Eigen::Matrix<double, kNumExtrinsicUnknowns, 3> weighted =
          HuberWeight(observation, solution.unknowns) *
          observation.jacobian.transpose();
      information.noalias() += weighted * observation.jacobian;
      right_side.noalias() += weighted * observation.residual;
    }
    solution.unknowns = information.ldlt().solve(right_side);
  }
  const Information covariance = information.inverse();
  solution.residual_variance = ResidualVariance(observations, solution);
  solution.covariance =
      std::max(1.0, solution.residual_variance) *
      (covariance.topLeftCorner<kNumRotationUnknowns, kNumRotationUnknowns>() +
       SpreadOfSpans(observations, solution, covariance));
  solution.observes_directions = std::any_of(
      observations.begin(), observations.end(),
      [](const ExtrinsicObservation& observation) {
        return !observation.jacobian.middleCols<3>(kDrivingDirectionUnknown)
                    .isZero();
      });
  solution.success =
      solution.unknowns.allFinite() && solution.covariance.allFinite();
  return solution;
}

int CountSpans(const std::vector<ExtrinsicPair>& pairs) {
  std::map<int, int> spans;
  for (const ExtrinsicPair& pair : pairs) ++spans[pair.span];
  return spans.size();
}

// The part of the camera-IMU rotation's error that exceeds its noise. In units
// of the prior sigmas, axes along which the data cannot separate this rotation
// from the direction of driving are zero.
Eigen::Vector3d KeepKnown(const CameraImuRotationOptions& options,
                          const RotationErrors& errors,
                          const RotationCovariance& covariance) {
  constexpr double kNumSigmas = 2.0;
  const RotationErrors sigmas =
      PriorSigmas(options).head<kNumRotationUnknowns>();
  const auto inverse = sigmas.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<RotationCovariance> eigen(
      RotationCovariance(inverse * covariance * inverse));
  RotationErrors along = eigen.eigenvectors().transpose() * (inverse * errors);
  for (int k = 0; k < kNumRotationUnknowns; ++k) {
    if (std::abs(along(k)) < kNumSigmas * std::sqrt(eigen.eigenvalues()(k))) {
      along(k) = 0.0;
    }
  }
  return (sigmas.asDiagonal() * (eigen.eigenvectors() * along)).head<3>();
}

// In the odometry chain's terms: directions of motion observe the sum of the
// camera-IMU rotation's error and that of the direction of driving.
SharedRotationErrors ToSharedErrors(const RotationErrors& errors,
                                    const RotationCovariance& covariance) {
  RotationCovariance shared_from_errors = RotationCovariance::Identity();
  shared_from_errors.bottomLeftCorner<3, 3>().setIdentity();
  const RotationErrors shared = shared_from_errors * errors;
  return {shared.head<3>(), shared.tail<3>(),
          shared_from_errors * covariance * shared_from_errors.transpose()};
}

}  // namespace

bool CameraImuRotationOptions::IsValid(std::string* error) const {
  return OptionChecker(error).Positive({{"sigma_deg", sigma_deg}}).AllHold();
}

std::map<int, Eigen::Quaterniond> CameraImuCorrections(
    const CameraImuRotationReports& reports) {
  std::map<int, Eigen::Quaterniond> corrections;
  for (const auto& [drive, report] : reports) {
    if (report.corrected) corrections.emplace(drive, report.Correction());
  }
  return corrections;
}

CameraImuRotationReport CorrectCameraImuRotation(
    const CameraImuRotationOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const GlobalCorrespondences& correspondences,
    std::vector<RelativePosePrior>* priors) {
  constexpr int kNumRounds = 4;
  constexpr double kSmallRotationRad = 1e-4;
  CameraImuRotationReport report;
  const std::vector<ExtrinsicPair> pairs =
      CollectExtrinsicPairs(chain, graph, correspondences, *priors);
  report.num_pairs = pairs.size();
  if (!options.enabled || CountSpans(pairs) < kMinNumSpans) return report;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  ExtrinsicSolution solution;
  for (int round = 0; round < kNumRounds; ++round) {
    solution = Solve(options, Observe(options, chain, pairs, rotation),
                     LogSo3(rotation));
    if (!solution.success) return report;
    rotation = ExpSo3(solution.unknowns.head<3>()) * rotation;
    if (solution.unknowns.head<3>().norm() < kSmallRotationRad) break;
  }
  report.rotation_rad = LogSo3(rotation);
  report.residual_variance = solution.residual_variance;
  const double floor_rad = DegToRad(kMinCameraImuSigmaDeg);
  const RotationCovariance covariance =
      solution.covariance +
      floor_rad * floor_rad * RotationCovariance::Identity();
  RotationErrors errors = solution.unknowns.head<kNumRotationUnknowns>();
  errors.head<3>() = report.rotation_rad;
  report.chi2 = errors.dot(covariance.ldlt().solve(errors));
  const Eigen::Vector3d axis = report.rotation_rad.normalized();
  report.sigma_rad =
      std::sqrt(axis.dot(covariance.topLeftCorner<3, 3>() * axis));
  const Eigen::Vector3d known = KeepKnown(options, errors, covariance);
  if (solution.observes_directions) {
    report.left_in_priors = ToSharedErrors(errors, covariance);
  }
  // Where the rotation's part does not clearly exceed the floor, the error is
  // in the direction of driving, which is an unknown of the adjustments.
  if (report.chi2 < kMinNumCameraImuSigmas * kMinNumCameraImuSigmas ||
      known.norm() < kMinNumCameraImuSigmas * floor_rad) {
    return report;
  }
  report.rotation_rad = known;
  report.corrected = true;
  if (report.left_in_priors) {
    report.left_in_priors->camera_imu_rad -= known;
    report.left_in_priors->driving_direction_rad -= known;
  }
  for (RelativePosePrior& prior : *priors) {
    RotatePrior(ExpSo3(report.rotation_rad), &prior);
  }
  return report;
}

}  // namespace adasfm
