// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/pose_prior_edge.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/median.h"

namespace adasfm {
namespace {

// A larger sigma leaves the direction unknown; a smaller length is no motion.
constexpr double kMaxDirectionSigmaRad = 0.5;
constexpr double kMinLengthM = 1e-9;

// Numbers the windows of one of the shared errors.
void AssignWindows(double window_s, int SharedErrorWindows::*number,
                   std::vector<PosePriorEdge>* edges) {
  int window = -1;
  double elapsed_s = 0.0;
  image_t last_image = kInvalidImageId;
  for (PosePriorEdge& edge : *edges) {
    if (edge.dt_s < 0.0) continue;
    if (window < 0 || edge.image_id1 != last_image || elapsed_s > window_s) {
      ++window;
      elapsed_s = 0.0;
    }
    edge.windows.*number = window;
    elapsed_s += edge.dt_s;
    last_image = edge.image_id2;
  }
}

}  // namespace

PosePriorEdge PosePriorEdgeFromPrior(const RelativePosePrior& prior) {
  PosePriorEdge edge;
  edge.image_id1 = prior.image_id1;
  edge.image_id2 = prior.image_id2;
  edge.cam2_from_cam1 = prior.cam2_from_cam1;
  edge.windows.drive = prior.drive;
  edge.windows.rotation_by_time_shift = prior.rotation_by_time_shift;
  // Within a frame of a rig no time passes, and no log measured the motion.
  if (prior.dt_ns > 0) edge.dt_s = SecondsFromNs(prior.dt_ns);
  const auto sigma_or_infinity = [](double variance) {
    return std::isfinite(variance) && variance > 0.0
               ? std::sqrt(variance)
               : std::numeric_limits<double>::infinity();
  };
  if (prior.HasRotation()) {
    edge.rotation_sigma_rad =
        sigma_or_infinity(prior.covariance.topLeftCorner<3, 3>().trace() / 3.0);
  }
  const Eigen::Vector3d& translation = prior.cam2_from_cam1.translation;
  const double length = std::max(kMinLengthM, translation.norm());
  if (!std::isfinite(length)) return edge;
  const Eigen::Matrix3d covariance = prior.covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d direction = translation / length;
  const double variance_along = direction.dot(covariance * direction);
  const double variance_across = (covariance.trace() - variance_along) / 2.0;
  // The accelerometer's information on the unit is applied to the adjusted
  // model as a whole (KeepInertialUnit); only across a gap it is a measurement.
  if (prior.HasOwnLength()) {
    edge.length_sigma_m = sigma_or_infinity(variance_along);
  }
  if (prior.HasDirection()) {
    edge.direction_sigma_rad = sigma_or_infinity(variance_across) / length;
  }
  // A motion below its own noise has no direction.
  if (edge.direction_sigma_rad > kMaxDirectionSigmaRad) {
    edge.direction_sigma_rad = std::numeric_limits<double>::infinity();
    if (prior.HasTranslation()) {
      edge.translation_sigma_m = sigma_or_infinity(covariance.trace() / 3.0);
      edge.length_sigma_m = std::numeric_limits<double>::infinity();
    }
  }
  return edge;
}

double MedianDirectionSigma(const std::vector<PosePriorEdge>& edges) {
  std::vector<double> sigmas;
  for (const PosePriorEdge& edge : edges) {
    if (edge.dt_s >= 0.0 && std::isfinite(edge.direction_sigma_rad)) {
      sigmas.push_back(edge.direction_sigma_rad);
    }
  }
  return UpperMedian(&sigmas);
}

void AssignSharedErrorWindows(const SharedErrorOptions& options,
                              std::vector<PosePriorEdge>* edges) {
  AssignWindows(options.gyroscope_window_s, &SharedErrorWindows::gyroscope,
                edges);
  AssignWindows(kDirectionWindowS, &SharedErrorWindows::direction, edges);
  std::set<int> drives;
  for (const PosePriorEdge& edge : *edges) {
    if (edge.MeasuresLength()) drives.insert(edge.windows.drive);
  }
  for (PosePriorEdge& edge : *edges) {
    edge.windows.has_length_scale = drives.size() > 1 && edge.MeasuresLength();
  }
  const double direction_sigma_rad = MedianDirectionSigma(*edges);
  if (!(direction_sigma_rad > 0.0)) return;
  for (PosePriorEdge& edge : *edges) {
    edge.windows.length_per_direction =
        options.length_drift_ratio / direction_sigma_rad;
  }
}

std::vector<PosePriorEdge> CorrectSharedErrors(
    const SharedErrorOptions& options, const SharedErrors& shared_errors,
    std::vector<PosePriorEdge> priors) {
  AssignSharedErrorWindows(options, &priors);
  for (PosePriorEdge& edge : priors) {
    if (edge.dt_s < 0.0) continue;
    edge.cam2_from_cam1 =
        shared_errors.Correct(edge.cam2_from_cam1, edge.dt_s, edge.windows);
  }
  return priors;
}

}  // namespace adasfm
