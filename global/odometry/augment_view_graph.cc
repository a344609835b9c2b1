// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/augment_view_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// A prior as an edge from the smaller to the larger id. False when an image is
// missing, the motion is not known (IsKnownMotion) or a value is not finite.
bool EdgeFromPrior(const AugmentationOptions& options,
                   const RelativePosePrior& prior, const ViewGraph& graph,
                   ViewGraphEdge* edge) {
  if (prior.image_id1 == prior.image_id2 ||
      graph.IndexOf(prior.image_id1) < 0 ||
      graph.IndexOf(prior.image_id2) < 0 || !IsKnownMotion(options, prior)) {
    return false;
  }
  const Eigen::Matrix3d rotation_covariance =
      prior.covariance.topLeftCorner<3, 3>();
  const Eigen::Matrix3d translation_covariance =
      prior.covariance.bottomRightCorner<3, 3>();
  *edge = ViewGraphEdge();
  edge->source = EdgeSource::kSensor;
  edge->image_id1 = prior.image_id1;
  edge->image_id2 = prior.image_id2;
  edge->cam2_from_cam1 = prior.cam2_from_cam1;
  edge->has_rotation = prior.HasRotation();
  if (edge->has_rotation) {
    edge->rotation_sigma_rad = std::sqrt(rotation_covariance.trace() / 3.0);
  }
  const double length = prior.cam2_from_cam1.translation.norm();
  if (prior.HasLength() && options.use_metric_lengths) edge->length_m = length;
  // A standstill has length zero and no direction, and is useful only if the
  // length is kept.
  constexpr double kMinLength = 1e-6;
  edge->has_translation = prior.HasRotation() && prior.HasDirection() &&
                          (length > kMinLength || edge->length_m.has_value());
  if (edge->has_translation) {
    const double sigma_m = std::sqrt(translation_covariance.trace() / 3.0);
    edge->direction_sigma_rad = sigma_m / std::max(length, kMinLength);
    edge->length_sigma_m = sigma_m;
    if (!edge->length_m.has_value()) {
      edge->cam2_from_cam1.translation /= length;
    }
  }
  if (edge->image_id1 > edge->image_id2) {
    std::swap(edge->image_id1, edge->image_id2);
    edge->cam2_from_cam1 = edge->cam2_from_cam1.Inverse();
  }
  return edge->cam2_from_cam1.ToMatrix().allFinite() &&
         std::isfinite(edge->rotation_sigma_rad) &&
         std::isfinite(edge->direction_sigma_rad);
}

}  // namespace

bool AugmentationOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .Positive({{"max_prior_time_gap_s", max_prior_time_gap_s}})
      .AllHold();
}

bool IsKnownMotion(const AugmentationOptions& options,
                   const RelativePosePrior& prior) {
  constexpr double kMaxRotationSigmaDeg = 1.0;
  constexpr double kMaxSigmaM = 0.05;
  constexpr double kMaxSigmaRatio = 0.05;
  if (std::abs(SecondsFromNs(prior.dt_ns)) <= options.max_prior_time_gap_s) {
    return true;
  }
  const Eigen::Matrix<double, 6, 1> variances = prior.covariance.diagonal();
  if (prior.HasRotation() && !(std::sqrt(variances.head<3>().maxCoeff()) <=
                               DegToRad(kMaxRotationSigmaDeg))) {
    return false;
  }
  const double max_sigma_m = std::max(
      kMaxSigmaM, kMaxSigmaRatio * prior.cam2_from_cam1.translation.norm());
  return !prior.HasTranslation() ||
         std::sqrt(variances.tail<3>().maxCoeff()) <= max_sigma_m;
}

int AddSensorEdges(const AugmentationOptions& options,
                   const std::vector<RelativePosePrior>& priors,
                   ViewGraph* graph) {
  if (!options.enabled) return 0;
  std::vector<ViewGraphEdge> added;
  int num_added = 0;
  for (const RelativePosePrior& prior : priors) {
    ViewGraphEdge edge;
    if (!EdgeFromPrior(options, prior, *graph, &edge)) continue;
    if (!edge.has_rotation) continue;
    const int existing = FindEdge(*graph, edge.Pair());
    if (existing < 0) {
      added.push_back(edge);
      ++num_added;
    } else if (!graph->edges[existing].IsKept()) {
      // The visual edge was removed; the prior replaces it.
      edge.num_inliers = 0;
      graph->edges[existing] = edge;
      ++num_added;
    }
  }
  graph->edges.insert(graph->edges.end(), added.begin(), added.end());
  std::stable_sort(graph->edges.begin(), graph->edges.end(),
                   [](const ViewGraphEdge& a, const ViewGraphEdge& b) {
                     return a.Pair() < b.Pair();
                   });
  graph->edges.erase(
      std::unique(graph->edges.begin(), graph->edges.end(),
                  [](const ViewGraphEdge& a, const ViewGraphEdge& b) {
                    return a.Pair() == b.Pair();
                  }),
      graph->edges.end());
  return num_added;
}

int AugmentTranslations(const AugmentationOptions& options,
                        const std::vector<RelativePosePrior>& priors,
                        ViewGraph* graph) {
  if (!options.enabled) return 0;
  int num_augmented = 0;
  for (const RelativePosePrior& prior : priors) {
    ViewGraphEdge sensor;
    if (!EdgeFromPrior(options, prior, *graph, &sensor)) continue;
    const int e = FindEdge(*graph, sensor.Pair());
    if (e < 0 || !graph->edges[e].IsKept()) continue;
    ViewGraphEdge* edge = &graph->edges[e];
    if (sensor.has_translation) {
      edge->cam2_from_cam1.translation = sensor.cam2_from_cam1.translation;
      edge->direction_sigma_rad = sensor.direction_sigma_rad;
      edge->has_translation = true;
      if (edge->source == EdgeSource::kVisual) {
        edge->source = EdgeSource::kAugmented;
      }
    } else if (sensor.length_m.has_value() && edge->has_translation) {
      // The sensors give the length alone, vision the direction.
      edge->cam2_from_cam1.translation =
          edge->cam2_from_cam1.translation.normalized() * *sensor.length_m;
    } else {
      continue;
    }
    edge->length_m = sensor.length_m;
    edge->length_sigma_m = sensor.length_sigma_m;
    ++num_augmented;
  }
  return num_augmented;
}

}  // namespace adasfm
