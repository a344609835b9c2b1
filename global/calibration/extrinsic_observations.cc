// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/extrinsic_observations.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/so3.h"
#include "global/two_view/minimize_epipolar_distances.h"
#include "global/two_view/translation_direction.h"

namespace adasfm {
namespace {

using Jacobian = Eigen::Matrix<double, 3, kNumExtrinsicUnknowns>;

// Pairs and matches beyond these add little.
constexpr size_t kMaxNumPairs = 2000;
constexpr int kMaxNumMatches = 150;
// Length of a span, in steps of the chain: pairs of one span share their
// errors.
constexpr int kSpanSteps = 10;
constexpr double kLossScalePx = 1.5;
// Least sigma of a rotation, of vision or sensors.
constexpr double kMinRotationSigmaRad = 5e-4;
// Sensors observe no direction of shorter motions.
constexpr double kMinLengthM = 0.05;
// Visual directions farther from the sensors' are rejected.
constexpr double kMaxDirectionErrorRad = 0.5;

// The motion of a pair with its priors rotated.
struct RotatedMotion {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d direction;
  // Of the rotation, and of the direction as a vector.
  Eigen::Matrix3d rotation_covariance;
  Eigen::Matrix3d direction_covariance;
  // Derivative of the rotation from the sensors' to the visual one (from the
  // left) by all unknowns, without vision's own offset.
  Jacobian rotation_change = Jacobian::Zero();
  Eigen::Matrix3d camera_from_middle;
  bool has_direction = false;
};

RotatedMotion RotateMotion(const ChainMotion& motion,
                           const Eigen::Quaterniond& turn, double seconds) {
  RotatedMotion rotated;
  const Eigen::Matrix3d matrix = turn.toRotationMatrix();
  const Eigen::Quaterniond rotation =
      turn * motion.cam2_from_cam1.rotation * turn.conjugate();
  rotated.rotation = rotation.toRotationMatrix();
  rotated.rotation_covariance =
      matrix * motion.covariance.topLeftCorner<3, 3>() * matrix.transpose();
  rotated.rotation_covariance.diagonal().array() +=
      kMinRotationSigmaRad * kMinRotationSigmaRad;
  // Exp(e) R Exp(-e) R^T = Exp((I - R) e). For the gyroscope's bias the mean
  // rotation of the frames in between is good enough for a few steps.
  rotated.rotation_change.leftCols<3>() =
      Eigen::Matrix3d::Identity() - rotated.rotation;
  const Eigen::Vector3d angles = LogSo3(rotation);
  rotated.camera_from_middle = ExpSo3(0.5 * angles).toRotationMatrix();
  rotated.rotation_change.middleCols<3>(kRateUnknown) =
      seconds * rotated.camera_from_middle;
  rotated.rotation_change.middleCols<3>(kScaleUnknown) = angles.asDiagonal();
  const Eigen::Vector3d& translation = motion.cam2_from_cam1.translation;
  const double length = translation.norm();
  rotated.has_direction = motion.has_position && length > kMinLengthM;
  if (!rotated.has_direction) return rotated;
  rotated.direction = matrix * translation / length;
  rotated.direction_covariance = matrix *
                                 motion.covariance.bottomRightCorner<3, 3>() *
                                 matrix.transpose() / (length * length);
  return rotated;
}

// Whitens `residual = jacobian * unknowns` of the first kRows rows.
template <int kRows>
ExtrinsicObservation Whiten(
    const ExtrinsicPair& pair,
    const Eigen::Matrix<double, kRows, kNumExtrinsicUnknowns>& jacobian,
    const Eigen::Matrix<double, kRows, 1>& residual,
    const Eigen::Matrix<double, kRows, kRows>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, kRows, kRows>> root(covariance);
  ExtrinsicObservation observation;
  observation.jacobian.setZero();
  observation.residual.setZero();
  observation.jacobian.template topRows<kRows>() =
      root.matrixL().solve(jacobian);
  observation.residual.template head<kRows>() = root.matrixL().solve(residual);
  observation.num_dof = kRows;
  observation.weight = 1.0 / pair.num_steps;
  observation.span = pair.span;
  return observation;
}

ExtrinsicObservation ObserveRotation(const ExtrinsicPair& pair,
                                     const RotatedMotion& motion) {
  Jacobian jacobian = motion.rotation_change;
  jacobian.rightCols<3>().setIdentity();
  const Eigen::Vector3d residual = LogSo3(
      pair.last_from_first * Eigen::Quaterniond(motion.rotation).conjugate());
  const double sigma = std::max(kMinRotationSigmaRad, pair.rotation_sigma_rad);
  return Whiten<3>(
      pair, jacobian, residual,
      motion.rotation_covariance + sigma * sigma * Eigen::Matrix3d::Identity());
}

bool ObservesExtrinsics(const OdometryChain& chain,
                        const GlobalCorrespondences& correspondences,
                        const ViewGraphEdge& edge) {
  return edge.IsKept() && edge.has_rotation &&
         edge.source != EdgeSource::kSensor &&
         chain.IsConnected(edge.image_id1, edge.image_id2) &&
         std::abs(chain.NumSteps(edge.image_id1, edge.image_id2)) <=
             kMaxNumExtrinsicSteps &&
         chain.Motion(edge.image_id1, edge.image_id2).has_rotation &&
         correspondences.matches.count(edge.Pair()) > 0;
}

// The sum of the steps' durations, by position in the chain; only differences
// within a piece mean anything.
std::map<int, double> SumSeconds(const OdometryChain& chain,
                                 const std::vector<RelativePosePrior>& priors) {
  std::map<int, double> seconds;
  for (const RelativePosePrior& prior : priors) {
    if (!chain.IsConnected(prior.image_id1, prior.image_id2)) continue;
    if (chain.NumSteps(prior.image_id1, prior.image_id2) != 1) continue;
    seconds.emplace(chain.Index(prior.image_id1), 0.0);
    seconds[chain.Index(prior.image_id2)] = SecondsFromNs(prior.dt_ns);
  }
  double sum = 0.0;
  for (auto& [index, value] : seconds) value = sum += value;
  return seconds;
}

ExtrinsicPair CreatePair(const OdometryChain& chain,
                         const GlobalCorrespondences& correspondences,
                         const ViewGraphEdge& edge) {
  ExtrinsicPair pair;
  pair.first = edge.image_id1;
  pair.last = edge.image_id2;
  pair.last_from_first = edge.cam2_from_cam1.rotation;
  pair.num_steps = chain.NumSteps(pair.first, pair.last);
  pair.rotation_sigma_rad = edge.rotation_sigma_rad;
  pair.bearings = SelectEdgeBearings(
      correspondences.bearings.at(edge.image_id1),
      correspondences.bearings.at(edge.image_id2),
      correspondences.matches.at(edge.Pair()), kMaxNumMatches);
  if (pair.num_steps < 0) {
    pair.num_steps = -pair.num_steps;
    std::swap(pair.first, pair.last);
    std::swap(pair.bearings.bearings1, pair.bearings.bearings2);
    pair.last_from_first = pair.last_from_first.conjugate();
  }
  pair.span = chain.Index(pair.first) / kSpanSteps;
  return pair;
}

}  // namespace

std::vector<ExtrinsicPair> CollectExtrinsicPairs(
    const OdometryChain& chain, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences,
    const std::vector<RelativePosePrior>& priors) {
  std::vector<const ViewGraphEdge*> edges;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (ObservesExtrinsics(chain, correspondences, edge)) {
      edges.push_back(&edge);
    }
  }
  const std::map<int, double> seconds = SumSeconds(chain, priors);
  std::vector<ExtrinsicPair> pairs;
  const size_t count = std::min(kMaxNumPairs, edges.size());
  for (size_t k = 0; k < count; ++k) {
    pairs.push_back(
        CreatePair(chain, correspondences, *edges[k * edges.size() / count]));
    pairs.back().seconds = seconds.at(chain.Index(pairs.back().last)) -
                           seconds.at(chain.Index(pairs.back().first));
  }
  return pairs;
}

std::vector<ExtrinsicObservation> ObserveExtrinsics(
    const OdometryChain& chain, const Eigen::Quaterniond& turn,
    const ExtrinsicPair& pair) {
  std::vector<ExtrinsicObservation> observations;
  const RotatedMotion motion =
      RotateMotion(chain.Motion(pair.first, pair.last), turn, pair.seconds);
  observations.push_back(ObserveRotation(pair, motion));
  if (!motion.has_direction) return observations;

  DirectionSearch search;
  search.loss_scale_px = kLossScalePx;
  search.search = false;
  search.max_num_iterations = 8;
  const TranslationProblem problem =
      BuildTranslationProblem(pair.bearings, motion.rotation);
  const Eigen::Vector3d direction =
      EstimateTranslationDirection(search, problem, motion.direction).direction;
  if (!(AngleBetweenRad(direction, motion.direction) < kMaxDirectionErrorRad) ||
      !(direction.norm() > 0.5)) {
    return observations;
  }
  const EpipolarInformation information =
      ComputeEpipolarInformation({kLossScalePx, kNumDirectionUnknowns},
                                 pair.bearings, {motion.rotation, direction});
  const Eigen::Matrix<double, 3, 2>& basis = information.basis;
  const Eigen::LLT<Eigen::Matrix2d> solver(
      information.matrix.bottomRightCorner<2, 2>());
  const Eigen::Matrix2d by_matches = solver.solve(Eigen::Matrix2d::Identity());
  if (solver.info() != Eigen::Success || !by_matches.allFinite()) {
    return observations;
  }
  // Minus the derivative of the direction of least distances by the held
  // rotation: the sensors' rotation is held, which is off by minus
  // rotation_change.
  const Eigen::Matrix<double, 2, 3> by_rotation =
      solver.solve(information.matrix.bottomLeftCorner<2, 3>());
  Eigen::Matrix<double, 2, kNumExtrinsicUnknowns> jacobian =
      by_rotation * motion.rotation_change;
  const Eigen::Matrix<double, 2, 3> by_extrinsics =
      -basis.transpose() * Hat(motion.direction);
  jacobian.leftCols<3>() += by_extrinsics;
  jacobian.middleCols<3>(kDrivingDirectionUnknown) +=
      by_extrinsics * motion.camera_from_middle;
  observations.push_back(Whiten<2>(
      pair, jacobian, -basis.transpose() * motion.direction,
      by_matches +
          by_rotation * motion.rotation_covariance * by_rotation.transpose() +
          basis.transpose() * motion.direction_covariance * basis));
  return observations;
}

}  // namespace adasfm
