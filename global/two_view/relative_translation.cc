// SPDX-License-Identifier: BSD-3-Clause
#include "global/two_view/relative_translation.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <atomic>
#include <cmath>

#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "global/two_view/detect_baseline.h"
#include "global/two_view/minimize_epipolar_distances.h"
#include "global/two_view/translation_direction.h"

namespace adasfm {
namespace {

// Matches beyond this many add nothing; an even subset is taken.
constexpr int kMaxNumMatches = 200;
constexpr int kMaxNumIterations = 20;
// Where the robust loss takes over: two sigmas of a keypoint, px.
constexpr double kLossScalePx = 1.0;

// 1 sigma along the larger axis of the direction's covariance, by the noise of
// the keypoints and the errors of the rotation.
double DirectionSigma(const RelativeTranslationOptions& options,
                      const EdgeBearings& bearings, const TwoViewPose& pose) {
  const EpipolarInformation information = ComputeEpipolarInformation(
      {kLossScalePx, kNumDirectionUnknowns}, bearings, pose);
  // The identity as ridge limits undetermined directions to a sigma of a
  // radian.
  const Eigen::Matrix2d by_matches =
      (information.matrix.bottomRightCorner<2, 2>() +
       Eigen::Matrix2d::Identity())
          .inverse();
  const Eigen::Matrix<double, 2, 3> by_rotation =
      DegToRad(options.rotation_sigma_deg) * by_matches *
      information.matrix.bottomLeftCorner<2, 3>();
  const Eigen::Matrix2d covariance =
      by_matches + by_rotation * by_rotation.transpose();
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance)
                       .eigenvalues()(1));
}

void RefineEdge(const RelativeTranslationOptions& options,
                const TranslationProblem& problem, ViewGraphEdge* edge) {
  DirectionSearch search;
  search.max_num_iterations = kMaxNumIterations;
  search.loss_scale_px = kLossScalePx;
  const Eigen::Vector3d start = edge->has_translation
                                    ? edge->cam2_from_cam1.translation
                                    : Eigen::Vector3d::Zero().eval();
  const Eigen::Vector3d direction =
      EstimateTranslationDirection(search, problem, start).direction;
  // Edges whose direction is less certain than this lose their translation.
  constexpr double kMaxDirectionSigmaRad = DegToRad(20.0);
  edge->has_translation = false;
  if (direction.norm() == 0.0) return;
  edge->cam2_from_cam1 = Rigid3d(problem.rotation, direction);
  edge->direction_sigma_rad =
      DirectionSigma(options, problem.bearings, {problem.rotation, direction});
  edge->has_baseline = DetectBaseline(problem.bearings, problem.rotation,
                                      direction, kMinKeypointSigmaPx);
  edge->has_translation =
      edge->has_baseline && edge->direction_sigma_rad < kMaxDirectionSigmaRad;
}

}  // namespace

bool RelativeTranslationOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .NotNegative({{"rotation_sigma_deg", rotation_sigma_deg}})
      .AllHold();
}

RelativeTranslationReport EstimateRelativeTranslations(
    const RelativeTranslationOptions& options,
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const GlobalCorrespondences& correspondences, ViewGraph* graph) {
  constexpr size_t kMinNumMatches = 5;
  std::vector<char> is_refined(graph->edges.size(), 0);
  ParallelFor(options.num_threads, graph->edges.size(), [&](size_t e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (!edge.IsKept() || edge.source != EdgeSource::kVisual) return;
    const auto matches = correspondences.matches.find(edge.Pair());
    if (matches == correspondences.matches.end() ||
        matches->second.size() < kMinNumMatches) {
      return;
    }
    const Eigen::Quaterniond rotation =
        cams_from_world.at(edge.image_id2) *
        cams_from_world.at(edge.image_id1).conjugate();
    RefineEdge(
        options,
        BuildTranslationProblem(
            SelectEdgeBearings(correspondences.bearings.at(edge.image_id1),
                               correspondences.bearings.at(edge.image_id2),
                               matches->second, kMaxNumMatches),
            rotation.toRotationMatrix()),
        &edge);
    is_refined[e] = 1;
  });
  RelativeTranslationReport report;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    if (!is_refined[e]) continue;
    ++report.num_refined;
    report.num_without_direction += !graph->edges[e].has_translation;
  }
  return report;
}

}  // namespace adasfm
