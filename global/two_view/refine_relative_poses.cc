// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/refine_relative_poses.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "core/option_checker.h"
#include "core/parallel.h"
#include "global/two_view/detect_baseline.h"
#include "global/two_view/minimize_epipolar_distances.h"
#include "global/two_view/translation_direction.h"
#include "global/view_graph/epipolar.h"

namespace adasfm {
namespace {

void SetSigmas(const Eigen::Matrix<double, 5, 5>& information,
               ViewGraphEdge* edge) {
  // What the matches do not determine is uncertain by a radian, not by
  // infinity.
  const Eigen::Matrix<double, 5, 5> covariance =
      (information + Eigen::Matrix<double, 5, 5>::Identity()).inverse();
  edge->rotation_sigma_rad =
      std::sqrt(covariance.topLeftCorner<3, 3>().trace() / 3.0);
  const Eigen::Matrix2d direction = covariance.bottomRightCorner<2, 2>();
  edge->direction_sigma_rad = std::sqrt(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(direction).eigenvalues()(
          1));
}

// Starts at the prediction, with the best direction for its rotation.
EpipolarMinimum MinimizeFromPrediction(const EpipolarMinimization& options,
                                       const EdgeBearings& bearings,
                                       const Eigen::Vector3d& direction) {
  DirectionSearch search;
  search.loss_scale_px = options.loss_scale_px;
  search.search = false;
  search.max_num_iterations = 6;
  TwoViewPose start;
  start.rotation = options.prediction.rotation;
  start.translation =
      EstimateTranslationDirection(
          search, BuildTranslationProblem(bearings, start.rotation), direction)
          .direction;
  return MinimizeEpipolarDistances(options, bearings, start);
}

void RefineEdge(const RelativePoseRefinementOptions& options,
                const EdgeBearings& bearings,
                const std::optional<RotationPrediction>& prediction,
                ViewGraphEdge* edge) {
  const auto compute_information = [&](const TwoViewPose& pose) {
    return ComputeEpipolarInformation({options.loss_scale_px, kNumPoseUnknowns},
                                      bearings, pose);
  };
  EpipolarMinimization minimization;
  minimization.max_num_iterations = options.max_num_iterations;
  minimization.loss_scale_px = options.loss_scale_px;
  const EpipolarMinimum own = MinimizeEpipolarDistances(
      minimization, bearings,
      {edge->cam2_from_cam1.rotation.toRotationMatrix(),
       edge->cam2_from_cam1.translation.normalized()});
  TwoViewPose pose = own.pose;
  EpipolarInformation information = compute_information(pose);
  if (prediction.has_value()) {
    // Largest cost of the pose with the prediction above the matches' own
    // minimum, in units of the noise's variance. Beyond, prediction and matches
    // contradict each other and the matches' own pose stays.
    constexpr double kMaxPredictionCost = 25.0;
    const double variance = information.cost_variance;
    const Eigen::Matrix3d predicted_information =
        prediction->covariance.inverse();
    minimization.prediction = {prediction->cam2_from_cam1.toRotationMatrix(),
                               variance * predicted_information};
    const EpipolarMinimum predicted =
        MinimizeFromPrediction(minimization, bearings, pose.translation);
    if (predicted.cost < own.cost + kMaxPredictionCost * variance) {
      pose = predicted.pose;
      information = compute_information(pose);
      information.matrix.topLeftCorner<3, 3>() += predicted_information;
    }
  }
  if (!pose.rotation.allFinite() || !pose.translation.allFinite()) return;
  if (!IsInFrontByVote(bearings.bearings1, bearings.bearings2,
                       std::vector<double>(bearings.bearings1.size(), 1.0),
                       pose.rotation, pose.translation)) {
    pose.translation = -pose.translation;
  }
  edge->cam2_from_cam1 = Rigid3d(pose.rotation, pose.translation);
  edge->has_baseline = DetectBaseline(bearings, pose.rotation, pose.translation,
                                      kMinKeypointSigmaPx);
  SetSigmas(information.matrix, edge);
}

}  // namespace

bool RelativePoseRefinementOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .AtLeast(1, "max_num_iterations", max_num_iterations)
      .AtLeast(8, "max_num_matches", max_num_matches)
      .Positive({{"loss_scale_px", loss_scale_px}})
      .AllHold();
}

void RefineRelativePoses(
    const RelativePoseRefinementOptions& options,
    const GlobalCorrespondences& correspondences,
    const std::vector<std::optional<RotationPrediction>>& predictions,
    ViewGraph* graph) {
  constexpr int kMinNumMatches = 8;
  ParallelFor(options.num_threads, graph->edges.size(), [&](size_t e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || edge.source != EdgeSource::kVisual) return;
    if (!edge.has_rotation || !edge.has_translation) return;
    const auto matches = correspondences.matches.find(edge.Pair());
    if (matches == correspondences.matches.end()) return;
    if (matches->second.size() < kMinNumMatches) return;
    RefineEdge(options,
               SelectEdgeBearings(correspondences.bearings.at(edge.image_id1),
                                  correspondences.bearings.at(edge.image_id2),
                                  matches->second, options.max_num_matches),
               predictions.empty() ? std::nullopt : predictions.at(e), &edge);
  });
}

}  // namespace adasfm
