// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/visual_odometry.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "core/median.h"
#include "core/so3.h"
#include "global/odometry/uncertain_motion.h"

namespace adasfm {
namespace {

// 1 sigma of a visual step's length, as a ratio.
constexpr double kLengthErrorRatio = 0.1;
// Least sigmas of a visual step's rotation (per axis) and direction, rad,
// before FitVisualSigmas. A few wrong matches that the pose of verification
// fits hold both in a second optimum, by far more than the sigmas of the pair
// (docs/reference/math.md, Step 1). The chain lets errors persist over all
// steps.
constexpr double kMinRotationSigma = 0.01;
constexpr double kMinDirectionSigma = 0.05;

int FindVisualEdge(const ViewGraph& graph, const ImagePair& pair) {
  const int e = FindEdge(graph, pair);
  if (e < 0) return -1;
  const ViewGraphEdge& edge = graph.edges[e];
  const bool is_visual =
      edge.IsKept() && edge.has_rotation && edge.source != EdgeSource::kSensor;
  return is_visual ? e : -1;
}

std::vector<image_t> InOrderOfCapture(const ViewGraph& graph) {
  std::vector<std::pair<int64_t, image_t>> ranked;
  for (size_t i = 0; i < graph.images.size(); ++i) {
    ranked.emplace_back(graph.CaptureRank(i), graph.images[i]);
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<image_t> images;
  for (const auto& [rank, image_id] : ranked) images.push_back(image_id);
  return images;
}

// Adds empty steps, to be filled, between neighbours in the order of capture
// that share a pair, where one piece of the chain ends and another begins.
std::vector<RelativePosePrior> ContinueChain(
    const ViewGraph& graph, std::vector<RelativePosePrior> priors,
    const std::vector<RelativePosePrior>& frame_priors) {
  std::set<image_t> has_next, has_previous, followers;
  for (const RelativePosePrior& prior : frame_priors) {
    followers.insert(prior.image_id2);
  }
  for (const RelativePosePrior& prior : priors) {
    has_next.insert(prior.image_id1);
    has_previous.insert(prior.image_id2);
  }
  std::vector<image_t> images = InOrderOfCapture(graph);
  images.erase(std::remove_if(images.begin(), images.end(),
                              [&followers](image_t image_id) {
                                return followers.count(image_id) > 0;
                              }),
               images.end());
  for (size_t k = 0; k + 1 < images.size(); ++k) {
    RelativePosePrior step;
    step.image_id1 = images[k];
    step.image_id2 = images[k + 1];
    const int e =
        FindVisualEdge(graph, ImagePair(step.image_id1, step.image_id2));
    if (has_next.count(step.image_id1) || has_previous.count(step.image_id2) ||
        e < 0 || graph.CaptureGap(graph.edges[e]) >= kRankGapOfDrives / 2) {
      continue;
    }
    priors.push_back(step);
  }
  return priors;
}

// Keeps only the pairs of images that follow each other closely: aliased pairs
// must not influence the lengths of the steps.
ViewGraph SequenceGraph(const ViewGraph& graph, const OdometryChain& chain) {
  ViewGraph sequence = graph;
  for (ViewGraphEdge& edge : sequence.edges) {
    const bool is_near =
        chain.IsConnected(edge.image_id1, edge.image_id2) &&
        std::abs(chain.NumSteps(edge.image_id1, edge.image_id2)) <=
            kMaxNumVisualSteps;
    if (!is_near) edge.removal = EdgeRemoval::kDisconnected;
  }
  return sequence;
}

void SetTranslation(const Eigen::Vector3d& translation,
                    const Eigen::Matrix3d& covariance,
                    RelativePosePrior* prior) {
  prior->cam2_from_cam1.translation = translation;
  prior->covariance.topRightCorner<3, 3>().setZero();
  prior->covariance.bottomLeftCorner<3, 3>().setZero();
  prior->covariance.bottomRightCorner<3, 3>() = covariance;
  prior->flags |= kPriorDirection | kPriorLength;
}

// The relative pose of the prior's images by vision, in the prior's order.
Rigid3d VisualMotion(const ViewGraphEdge& edge,
                     const RelativePosePrior& prior) {
  return edge.image_id1 == prior.image_id1 ? edge.cam2_from_cam1
                                           : edge.cam2_from_cam1.Inverse();
}

void FillRotation(const ViewGraphEdge& edge, RelativePosePrior* prior) {
  const double sigma_rad = std::max(edge.rotation_sigma_rad, kMinRotationSigma);
  prior->cam2_from_cam1.rotation = VisualMotion(edge, *prior).rotation;
  prior->covariance.setZero();
  prior->covariance.topLeftCorner<3, 3>() =
      sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  prior->flags |= kPriorRotation;
}

void FillPosition(const ViewGraphEdge& edge, const EdgeLength& length,
                  RelativePosePrior* prior) {
  const Eigen::Vector3d direction =
      VisualMotion(edge, *prior).translation.normalized();
  const double along =
      length.length * std::hypot(length.log_sigma, kLengthErrorRatio);
  const double across =
      length.length * std::max(edge.direction_sigma_rad, kMinDirectionSigma);
  SetTranslation(length.length * direction,
                 CovarianceAlong(direction, along, across), prior);
}

double MedianLength(const std::vector<RelativePosePrior>& priors) {
  std::vector<double> lengths;
  for (const RelativePosePrior& prior : priors) {
    const double length = prior.cam2_from_cam1.translation.norm();
    if (prior.HasTranslation() && length > 0.0) lengths.push_back(length);
  }
  return lengths.empty() ? 1.0 : UpperMedian(&lengths);
}

}  // namespace

VisualOdometryEdges AddVisualOdometry(
    int num_threads, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences,
    const std::map<ImagePair, double>& known_lengths_m,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<RelativePosePrior>& frame_priors) {
  VisualOdometryEdges steps;
  steps.priors = ContinueChain(graph, priors, frame_priors);
  const OdometryChain chain(steps.priors, OdometryChainOptions(), frame_priors);
  const EdgeLengths lengths =
      EstimateEdgeLengths(num_threads, SequenceGraph(graph, chain),
                          known_lengths_m, correspondences);

  // Steps that vision observes; a standstill's sigma depends on the other
  // lengths.
  std::vector<RelativePosePrior*> standstills;
  std::map<ImagePair, double> known_lengths = known_lengths_m;
  for (RelativePosePrior& prior : steps.priors) {
    if (prior.HasMotion()) continue;
    const ImagePair pair(prior.image_id1, prior.image_id2);
    const int e = FindVisualEdge(graph, pair);
    if (e < 0) continue;
    if (!prior.HasRotation()) FillRotation(graph.edges[e], &prior);
    if (!graph.edges[e].has_baseline) {
      standstills.push_back(&prior);
      continue;
    }
    if (!graph.edges[e].has_translation || !lengths.lengths[e]) continue;
    FillPosition(graph.edges[e], *lengths.lengths[e], &prior);
    known_lengths[pair] = lengths.lengths[e]->length;
    ++steps.num_by_vision;
  }
  const double sigma = kLengthErrorRatio * MedianLength(steps.priors);
  for (RelativePosePrior* prior : standstills) {
    SetTranslation(Eigen::Vector3d::Zero(),
                   sigma * sigma * Eigen::Matrix3d::Identity(), prior);
    ++steps.num_by_vision;
  }
  if (!lengths.metric) steps.unit_m = MedianLength(steps.priors);
  steps.lengths =
      EstimateEdgeLengths(num_threads, graph, known_lengths, correspondences);
  return steps;
}

void ScaleVisualSigmas(const std::vector<RelativePosePrior>& given,
                       double ratio, std::vector<RelativePosePrior>* steps) {
  for (size_t k = 0; k < steps->size(); ++k) {
    Eigen::Matrix<double, 6, 6>& covariance = (*steps)[k].covariance;
    if (k >= given.size() || !given[k].HasRotation()) {
      covariance.topLeftCorner<3, 3>() *= ratio * ratio;
    }
    if (k >= given.size() || !given[k].HasMotion()) {
      covariance.bottomRightCorner<3, 3>() *= ratio * ratio;
    }
  }
}

}  // namespace adasfm
