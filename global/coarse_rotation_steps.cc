// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "core/prior_lengths.h"
#include "core/so3.h"
#include "global/calibration/extrinsic_observations.h"
#include "global/coarse_pose_estimator.h"
#include "global/loop_closures/judge_visual_odometry.h"
#include "global/odometry/visual_odometry.h"
#include "global/rotation_averaging/filter_edges_by_rotation.h"

namespace adasfm {
namespace {

std::string DescribeCameraImuRotations(
    const CameraImuRotationReports& camera_imu_rotations) {
  std::string description;
  for (const auto& [drive, camera_imu] : camera_imu_rotations) {
    if (!camera_imu.corrected) continue;
    char text[96];
    std::snprintf(text, sizeof(text), "%s%.2f +- %.2f deg",
                  description.empty() ? ", camera turned by " : " and ",
                  RadToDeg(camera_imu.rotation_rad.norm()),
                  RadToDeg(camera_imu.sigma_rad));
    description += text;
  }
  return description;
}

}  // namespace

void CoarsePoseEstimator::RefinePairs() {
  int num_removed = 0;
  for (ViewGraphEdge& edge : graph_.edges) {
    if (!edge.IsKept() || edge.num_inliers >= options_.min_num_inliers) {
      continue;
    }
    edge.removal = EdgeRemoval::kFewInliers;
    ++num_removed;
  }
  BuildChain();
  if (options_.relative_poses.enabled) {
    RefineRelativePoses(options_.relative_poses, correspondences_,
                        PredictRotations(), &graph_);
  }
  EndStep("relative poses",
          std::to_string(graph_.edges.size()) + " pairs, " +
              std::to_string(num_removed) + " with few inliers removed" +
              DescribeCameraImuRotations(result_.camera_imu_rotations));
}

// The chain, with what vision observes of the camera-IMU rotation and of the
// direction of driving.
void CoarsePoseEstimator::BuildChain() {
  chain_ = OdometryChain(priors_, chain_options_, frame_priors_);
  const CameraImuRotationOptions& camera_imu = options_.camera_imu_rotation;
  if (chain_.empty() || !options_.relative_poses.enabled ||
      !camera_imu.enabled) {
    return;
  }
  ViewGraph near = graph_;
  near.edges.erase(
      std::remove_if(
          near.edges.begin(), near.edges.end(),
          [&](const ViewGraphEdge& edge) {
            return chain_.IsFollower(edge.image_id1) ||
                   chain_.IsFollower(edge.image_id2) ||
                   !chain_.IsConnected(edge.image_id1, edge.image_id2) ||
                   std::abs(chain_.NumSteps(edge.image_id1, edge.image_id2)) >
                       kMaxNumExtrinsicSteps;
          }),
      near.edges.end());
  RefineRelativePoses(options_.relative_poses, correspondences_, {}, &near);
  std::map<int, std::vector<RelativePosePrior>> by_drive;
  for (const RelativePosePrior& prior : priors_) {
    by_drive[prior.drive].push_back(prior);
  }
  priors_.clear();
  for (auto& [drive, priors] : by_drive) {
    // The errors that all steps share are the unknowns here and no noise.
    const OdometryChain independent(priors, WithoutSharedErrors(options_.chain),
                                    frame_priors_);
    const CameraImuRotationReport report = CorrectCameraImuRotation(
        camera_imu, independent, near, correspondences_, &priors);
    result_.camera_imu_rotations.emplace(drive, report);
    if (report.left_in_priors) {
      chain_options_.shared_rotation_errors.emplace(drive,
                                                    *report.left_in_priors);
    }
    priors_.insert(priors_.end(), priors.begin(), priors.end());
  }
  chain_ = OdometryChain(priors_, chain_options_, frame_priors_);
}

std::vector<std::optional<RotationPrediction>>
CoarsePoseEstimator::PredictRotations() const {
  // What calibration and rolling shutter add to the odometry's rotation between
  // two cameras, 1 sigma.
  constexpr double kMinPredictedSigmaRad = DegToRad(0.05);
  std::vector<std::optional<RotationPrediction>> predictions;
  for (const ViewGraphEdge& edge : graph_.edges) {
    predictions.emplace_back();
    if (!chain_.IsConnected(edge.image_id1, edge.image_id2)) continue;
    const ChainMotion motion = chain_.Motion(edge.image_id1, edge.image_id2);
    if (!motion.has_rotation) continue;
    predictions.back() =
        RotationPrediction{motion.cam2_from_cam1.rotation,
                           motion.covariance.topLeftCorner<3, 3>() +
                               kMinPredictedSigmaRad * kMinPredictedSigmaRad *
                                   Eigen::Matrix3d::Identity()};
  }
  return predictions;
}

void CoarsePoseEstimator::FilterLoops() {
  if (!options_.loops.enabled) {
    EndStep("loop closures", "switched off");
    return;
  }
  lengths_ = EstimateLengths();
  std::string steps_summary;
  const TrajectoryOdometry odometry = BuildTrajectoryOdometry(&steps_summary);
  LoopClosureOptions options = options_.loops;
  // Photos in any order have no segments to keep apart.
  options.split_unconfirmed_closures &=
      !priors_.empty() || IsSequence(odometry.chain);
  result_.loop_closures = FilterLoopClosures(options, odometry, &graph_);
  const LoopClosureReport& report = result_.loop_closures;
  // Lengths that were propagated through removed pairs are discarded.
  if (report.segments_were_split &&
      report.num_pairs_of_unconfirmed_closures > 0) {
    lengths_ = EdgeLengths();
  }
  std::string summary = std::to_string(report.num_tested) + " pairs tested, " +
                        std::to_string(report.num_contradicting) +
                        " contradict the odometry; " +
                        std::to_string(report.num_clusters) + " loops, " +
                        std::to_string(report.num_false_clusters) + " false (" +
                        std::to_string(report.num_pairs_of_false_clusters) +
                        " more pairs)" + steps_summary;
  if (report.num_confirmed_closures + report.unconfirmed_closures.size() > 0) {
    summary += "; " + std::to_string(report.num_segments) + " segments, " +
               std::to_string(report.num_confirmed_closures) +
               " closures between them confirmed, " +
               std::to_string(report.unconfirmed_closures.size()) +
               (report.segments_were_split ? " rejected" : " not confirmed");
  }
  EndStep("loop closures", summary);
}

// The priors, completed by vision where sensors miss a step.
TrajectoryOdometry CoarsePoseEstimator::BuildTrajectoryOdometry(
    std::string* summary) const {
  TrajectoryOdometry odometry;
  odometry.priors = priors_;
  odometry.chain = chain_;
  EdgeLengths lengths = lengths_;
  VisualOdometryEdges steps = CompleteOdometry();
  if (!steps.priors.empty()) {
    OdometryChainOptions options = chain_options_;
    if (!HasLengths(priors_)) {
      options.scale_drift_ratio = kVisualScaleDriftRatio;
    }
    const int num_rejected = RejectVisualOdometry(
        options_.loops, options, graph_, priors_.size(), &steps);
    const double sigma_ratio =
        FitVisualSigmas(priors_, options, graph_, &steps);
    odometry.chain = OdometryChain(steps.priors, options, frame_priors_);
    odometry.unit = steps.unit_m;
    lengths = steps.lengths;
    char text[128];
    std::snprintf(text, sizeof(text),
                  "; vision gave %d odometry edges a position, sigmas times "
                  "%.2f, %d visual odometry edges rejected",
                  steps.num_by_vision, sigma_ratio, num_rejected);
    *summary = text;
  }
  odometry.lengths.resize(graph_.edges.size());
  if (lengths.metric) odometry.lengths = lengths.lengths;
  return odometry;
}

// Whether the chain contains nearly all of the images that share a pair.
bool CoarsePoseEstimator::IsSequence(const OdometryChain& chain) const {
  std::set<image_t> images;
  for (const ViewGraphEdge& edge : graph_.edges) {
    if (!edge.IsKept()) continue;
    images.insert(edge.image_id1);
    images.insert(edge.image_id2);
  }
  const auto num_in_chain = std::count_if(
      images.begin(), images.end(),
      [&chain](image_t image_id) { return chain.Index(image_id) >= 0; });
  constexpr double kMinRatio = 0.8;
  return num_in_chain >= kMinRatio * images.size();
}

// Empty where sensors measure all motions, or without visual odometry.
VisualOdometryEdges CoarsePoseEstimator::CompleteOdometry() const {
  if (!options_.use_visual_odometry) return VisualOdometryEdges();
  const image_t first = graph_.images.empty() ? 0 : graph_.images.front();
  const bool is_complete = std::all_of(
      graph_.images.begin(), graph_.images.end(), [&](image_t image_id) {
        if (!chain_.IsConnected(first, image_id)) return false;
        const ChainMotion motion = chain_.Motion(first, image_id);
        return motion.has_rotation && motion.has_position;
      });
  if (is_complete) return VisualOdometryEdges();
  return AddVisualOdometry(options_.num_threads, graph_, correspondences_,
                           KnownLengths(), priors_, frame_priors_);
}

std::vector<RelativePosePrior> CoarsePoseEstimator::AllPriors() const {
  std::vector<RelativePosePrior> all = priors_;
  all.insert(all.end(), frame_priors_.begin(), frame_priors_.end());
  return all;
}

// Lengths found before stay with their edges.
int CoarsePoseEstimator::AddSensors() {
  std::map<ImagePair, std::optional<EdgeLength>> lengths;
  for (size_t e = 0; e < lengths_.lengths.size(); ++e) {
    lengths[graph_.edges[e].Pair()] = lengths_.lengths[e];
  }
  const int num_added =
      AddSensorEdges(options_.augmentation, AllPriors(), &graph_);
  if (lengths.empty()) return num_added;
  lengths_.lengths.clear();
  for (const ViewGraphEdge& edge : graph_.edges) {
    lengths_.lengths.push_back(lengths[edge.Pair()]);
  }
  return num_added;
}

void CoarsePoseEstimator::EstimateRotations() {
  const int num_added = AddSensors();
  int num_converged = 0;
  int num_components = 0;
  for (const std::vector<image_t>& images : FindConnectedComponents(graph_)) {
    if (images.size() < 2) break;
    const GlobalRotations rotations = EstimateGlobalRotations(
        options_.rotations, ExtractSubgraph(graph_, images));
    if (!rotations.success) continue;
    for (const auto& [image_id, rotation] : rotations.cams_from_world) {
      rotations_[image_id] = rotation;
      rotation_converged_[image_id] = rotations.converged;
      sdp_optimality_[image_id] = rotations.sdp_optimality;
    }
    ++num_components;
    num_converged += rotations.converged;
  }
  EndStep("rotation averaging",
          std::to_string(num_added) + " sensor edges added, " +
              std::to_string(rotations_.size()) + " of " +
              std::to_string(graph_.images.size()) + " images in " +
              std::to_string(num_components) +
              (num_components == 1 ? " component, " : " components, ") +
              std::to_string(num_converged) + " converged");
}

void CoarsePoseEstimator::FilterByRotation() {
  int num_removed = FilterEdgesByRotation(options_.max_rotation_discrepancy_deg,
                                          rotations_, &graph_);
  // Consecutive images whose visual edge was removed get the sensors' edge.
  const int num_added = AddSensors();
  num_removed += FilterEdgesByRotation(options_.max_rotation_discrepancy_deg,
                                       rotations_, &graph_);
  EndStep("rotation filter", std::to_string(num_removed) + " removed, " +
                                 std::to_string(num_added) +
                                 " sensor edges added");
}

// Global rotations distinguish the two optima of nearly planar pairs that
// odometry does not predict. Removed pairs stay removed: refined towards the
// prediction, a wrong one would look right.
void CoarsePoseEstimator::RepeatRotations() {
  const auto predictions = PredictFromRotations();
  if (std::none_of(predictions.begin(), predictions.end(),
                   [](const auto& p) { return p.has_value(); })) {
    return;
  }
  if (options_.relative_poses.enabled) {
    RefineRelativePoses(options_.relative_poses, correspondences_, predictions,
                        &graph_);
  }
  EstimateRotations();
  FilterByRotation();
}

// For pairs that odometry does not predict.
std::vector<std::optional<RotationPrediction>>
CoarsePoseEstimator::PredictFromRotations() const {
  // 1 sigma of the global rotations of the previous round between two images.
  constexpr double kGlobalRotationSigmaRad = DegToRad(1.0);
  std::vector<std::optional<RotationPrediction>> predictions;
  for (const ViewGraphEdge& edge : graph_.edges) {
    predictions.emplace_back();
    const auto rotation1 = rotations_.find(edge.image_id1);
    const auto rotation2 = rotations_.find(edge.image_id2);
    if (rotation1 == rotations_.end() || rotation2 == rotations_.end() ||
        chain_.IsConnected(edge.image_id1, edge.image_id2)) {
      continue;
    }
    predictions.back() =
        RotationPrediction{rotation2->second * rotation1->second.conjugate(),
                           kGlobalRotationSigmaRad * kGlobalRotationSigmaRad *
                               Eigen::Matrix3d::Identity()};
  }
  return predictions;
}

}  // namespace adasfm
