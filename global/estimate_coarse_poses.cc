// SPDX-License-Identifier: BSD-3-Clause
#include "global/estimate_coarse_poses.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/so3.h"
#include "global/filter_edges_by_rotation.h"

namespace adasfm {
namespace {

using Rotations = std::map<image_t, Eigen::Quaterniond>;

// The state that the steps hand on; one member function a step.
class CoarsePoseEstimator {
 public:
  CoarsePoseEstimator(const CoarsePoseOptions& options, const ViewGraph& graph,
                      const GlobalCorrespondences& correspondences,
                      const std::vector<RelativePosePrior>& priors)
      : options_(options),
        correspondences_(correspondences),
        priors_(priors),
        graph_(graph),
        step_start_(std::chrono::steady_clock::now()) {}

  CoarsePoses Run() {
    RefinePairs();
    FilterLoops();
    EstimateRotations();
    FilterByRotation();
    if (options_.num_rotation_rounds > 1) RepeatRotations();
    EstimateTranslations();
    EstimatePositions();
    result_.graph = std::move(graph_);
    result_.priors = std::move(priors_);
    return std::move(result_);
  }

 private:
  void RefinePairs() {
    int num_removed = 0;
    for (ViewGraphEdge& edge : graph_.edges) {
      if (!edge.IsKept() || edge.num_inliers >= options_.min_num_inliers) {
        continue;
      }
      edge.removal = EdgeRemoval::kFewInliers;
      ++num_removed;
    }
    const RotationRateReport rates = BuildChain();
    if (options_.relative_poses.enabled) {
      RefineRelativePoses(options_.relative_poses, correspondences_,
                          PredictRotations(), &graph_);
    }
    EndStep("relative poses", std::to_string(graph_.edges.size()) + " pairs, " +
                                  std::to_string(num_removed) +
                                  " with few inliers removed, odometry turned "
                                  "by up to " +
                                  std::to_string(rates.max_rate_rad_s) +
                                  " rad/s");
  }

  // The chain, after vision has corrected its rotations.
  RotationRateReport BuildChain() {
    chain_ = OdometryChain(priors_, options_.chain);
    if (chain_.empty() || !options_.relative_poses.enabled ||
        !options_.rotation_rates.enabled) {
      return RotationRateReport();
    }
    ViewGraph near = graph_;
    near.edges.erase(
        std::remove_if(
            near.edges.begin(), near.edges.end(),
            [this](const ViewGraphEdge& edge) {
              return !chain_.IsConnected(edge.image_id1, edge.image_id2) ||
                     std::abs(chain_.NumSteps(edge.image_id1, edge.image_id2)) >
                         options_.rotation_rates.max_num_steps;
            }),
        near.edges.end());
    RefineRelativePoses(options_.relative_poses, correspondences_, {}, &near);
    const RotationRateReport report =
        CorrectRotationRates(options_.rotation_rates, chain_, near, &priors_);
    chain_ = OdometryChain(priors_, options_.chain);
    return report;
  }

  std::vector<std::optional<RotationPrediction>> PredictRotations() const {
    const double floor_rad =
        DegToRad(options_.min_predicted_rotation_sigma_deg);
    std::vector<std::optional<RotationPrediction>> predictions;
    for (const ViewGraphEdge& edge : graph_.edges) {
      predictions.emplace_back();
      if (!chain_.IsConnected(edge.image_id1, edge.image_id2)) continue;
      const ChainMotion motion = chain_.Motion(edge.image_id1, edge.image_id2);
      if (!motion.has_rotation) continue;
      predictions.back() = RotationPrediction{
          motion.cam2_from_cam1.rotation,
          motion.covariance.topLeftCorner<3, 3>() +
              floor_rad * floor_rad * Eigen::Matrix3d::Identity()};
    }
    return predictions;
  }

  void FilterLoops() {
    if (chain_.empty() || !options_.loops.enabled) {
      EndStep("loop gating",
              chain_.empty() ? "skipped: no odometry" : "switched off");
      return;
    }
    lengths_ = EstimateLengths();
    const LoopFilterReport report =
        FilterLoopsByOdometry(options_.loops, chain_, lengths_, &graph_);
    EndStep("loop gating",
            std::to_string(report.num_tested) + " pairs tested, " +
                std::to_string(report.num_contradicting) +
                " contradict the odometry, " +
                std::to_string(report.num_in_false_runs) + " more lie in its " +
                std::to_string(report.num_false_runs) + " false runs");
  }

  void EstimateRotations() {
    const int num_added =
        AddSensorEdges(options_.augmentation, priors_, &graph_);
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
                std::to_string(num_components) + " components, " +
                std::to_string(num_converged) + " converged");
  }

  void FilterByRotation() {
    int num_removed = FilterEdgesByRotation(
        options_.max_rotation_discrepancy_deg, rotations_, &graph_);
    // Consecutive images that lost their visual edge keep the sensors'.
    const int num_added =
        AddSensorEdges(options_.augmentation, priors_, &graph_);
    num_removed += FilterEdgesByRotation(options_.max_rotation_discrepancy_deg,
                                         rotations_, &graph_);
    EndStep("rotation filter", std::to_string(num_removed) + " removed, " +
                                   std::to_string(num_added) +
                                   " sensor edges added");
  }

  // Global rotations tell the two optima of nearly planar pairs apart, as
  // odometry does for the others. Removed pairs stay removed: bent towards the
  // prediction, a wrong one would look right.
  void RepeatRotations() {
    for (int round = 1; round < options_.num_rotation_rounds; ++round) {
      const auto predictions = PredictFromRotations();
      if (std::none_of(predictions.begin(), predictions.end(),
                       [](const auto& p) { return p.has_value(); })) {
        return;
      }
      if (options_.relative_poses.enabled) {
        RefineRelativePoses(options_.relative_poses, correspondences_,
                            predictions, &graph_);
      }
      EstimateRotations();
      FilterByRotation();
    }
  }

  // For pairs that odometry does not predict.
  std::vector<std::optional<RotationPrediction>> PredictFromRotations() const {
    const double sigma_rad = DegToRad(options_.global_rotation_sigma_deg);
    std::vector<std::optional<RotationPrediction>> predictions;
    for (const ViewGraphEdge& edge : graph_.edges) {
      predictions.emplace_back();
      const auto rotation1 = rotations_.find(edge.image_id1);
      const auto rotation2 = rotations_.find(edge.image_id2);
      if (rotation1 == rotations_.end() || rotation2 == rotations_.end() ||
          chain_.IsConnected(edge.image_id1, edge.image_id2)) {
        continue;
      }
      predictions.back() = RotationPrediction{
          rotation2->second * rotation1->second.conjugate(),
          sigma_rad * sigma_rad * Eigen::Matrix3d::Identity()};
    }
    return predictions;
  }

  void EstimateTranslations() {
    RelativeTranslationReport report;
    if (options_.translations.enabled) {
      report = EstimateRelativeTranslations(options_.translations, rotations_,
                                            correspondences_, &graph_);
    }
    const int num_augmented =
        AugmentTranslations(options_.augmentation, priors_, &graph_);
    EndStep("relative translations",
            std::to_string(report.num_refined) + " refined, " +
                std::to_string(report.num_without_direction) +
                " without direction, " + std::to_string(num_augmented) +
                " from sensors");
  }

  void EstimatePositions() {
    lengths_ = EstimateLengths();
    // Unit vectors throughout, as the paper has it: shared points must not
    // bring the metres back.
    if (!options_.augmentation.use_metric_lengths) lengths_ = EdgeLengths();
    ViewGraph directed = graph_;
    for (ViewGraphEdge& edge : directed.edges) {
      if (!edge.has_translation) edge.removal = EdgeRemoval::kTranslation;
    }
    int num_images = 0;
    int num_iterations = 0;
    for (const std::vector<image_t>& images :
         FindConnectedComponents(directed)) {
      if (images.size() < 2) break;
      num_iterations += EstimateComponent(images);
    }
    for (const CoarseComponent& component : result_.components) {
      num_images += component.cams_from_world.size();
    }
    const int num_removed = RemoveEdgesOffPositions();
    EndStep("translation averaging",
            std::to_string(num_images) + " images in " +
                std::to_string(result_.components.size()) + " components, " +
                std::to_string(num_iterations) + " iterations, " +
                std::to_string(num_removed) + " edges removed");
  }

  // Returns the number of iterations.
  int EstimateComponent(const std::vector<image_t>& images) {
    const ViewGraph subgraph = ExtractSubgraph(graph_, images);
    const GlobalPositions positions = EstimateGlobalPositions(
        options_.positions, subgraph, rotations_, SelectLengths(subgraph),
        StartFromChain(images));
    if (!positions.success) return positions.num_iterations;
    CoarseComponent component;
    component.metric = positions.metric;
    component.positions_converged = positions.converged;
    component.rotations_converged = rotation_converged_.at(images.front());
    component.sdp_optimality = sdp_optimality_.at(images.front());
    for (const image_t image_id : images) {
      component.cams_from_world[image_id] = CamFromWorldWithCenter(
          rotations_.at(image_id), positions.centers.at(image_id));
    }
    result_.components.push_back(std::move(component));
    return positions.num_iterations;
  }

  int RemoveEdgesOffPositions() {
    std::map<image_t, Eigen::Vector3d> centers;
    std::map<image_t, size_t> component_of;
    for (size_t k = 0; k < result_.components.size(); ++k) {
      for (const auto& [image_id, pose] :
           result_.components[k].cams_from_world) {
        centers[image_id] = pose.TargetOriginInSource();
        component_of[image_id] = k;
      }
    }
    int num_removed = 0;
    for (ViewGraphEdge& edge : graph_.edges) {
      if (!edge.IsKept()) continue;
      const auto component1 = component_of.find(edge.image_id1);
      const auto component2 = component_of.find(edge.image_id2);
      if (component1 == component_of.end() ||
          component2 == component_of.end() ||
          component1->second != component2->second) {
        edge.removal = EdgeRemoval::kDisconnected;
        ++num_removed;
      }
    }
    // Lengths have one unit only when they are metres.
    return num_removed +
           FilterEdgesByPosition(options_.position_filter, rotations_, centers,
                                 lengths_.metric ? lengths_.lengths
                                                 : decltype(lengths_.lengths)(),
                                 &graph_);
  }

  // Metres of the priors that augment the graph, spread over shared points.
  EdgeLengths EstimateLengths() const {
    std::map<ImagePair, double> known_lengths_m;
    for (const RelativePosePrior& prior : priors_) {
      const double length = prior.cam2_from_cam1.translation.norm();
      if (prior.HasLength() && length >= options_.min_known_length_m &&
          std::abs(SecondsFromNs(prior.dt_ns)) <=
              options_.augmentation.max_prior_time_gap_s) {
        known_lengths_m[ImagePair(prior.image_id1, prior.image_id2)] = length;
      }
    }
    return EstimateEdgeLengths(options_.lengths, graph_, known_lengths_m,
                               correspondences_, lengths_);
  }

  std::vector<std::optional<EdgeLength>> SelectLengths(
      const ViewGraph& subgraph) const {
    std::vector<std::optional<EdgeLength>> selected;
    if (lengths_.lengths.empty()) return selected;
    size_t e = 0;
    for (const ViewGraphEdge& edge : subgraph.edges) {
      while (graph_.edges[e].Pair() < edge.Pair()) ++e;
      selected.push_back(lengths_.lengths[e]);
    }
    return selected;
  }

  // The priors' translations under the global rotations; empty unless they
  // reach all images.
  std::map<image_t, Eigen::Vector3d> StartFromChain(
      std::vector<image_t> images) const {
    std::map<image_t, Eigen::Vector3d> centers;
    if (!options_.augmentation.enabled ||
        !options_.augmentation.use_metric_lengths) {
      return centers;
    }
    std::sort(images.begin(), images.end(), [this](image_t a, image_t b) {
      return chain_.Index(a) < chain_.Index(b);
    });
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (size_t k = 0; k < images.size(); ++k) {
      if (k > 0) {
        if (!chain_.IsConnected(images[k - 1], images[k])) return {};
        const ChainMotion motion = chain_.Motion(images[k - 1], images[k]);
        if (!motion.has_position) return {};
        center -= rotations_.at(images[k]).conjugate() *
                  motion.cam2_from_cam1.translation;
      }
      centers[images[k]] = center;
    }
    return centers;
  }

  void EndStep(const std::string& name, const std::string& summary) {
    const auto now = std::chrono::steady_clock::now();
    result_.steps.push_back(
        {name, std::chrono::duration<double>(now - step_start_).count(),
         summary});
    step_start_ = now;
  }

  const CoarsePoseOptions& options_;
  const GlobalCorrespondences& correspondences_;
  std::vector<RelativePosePrior> priors_;
  ViewGraph graph_;
  OdometryChain chain_;
  EdgeLengths lengths_;
  Rotations rotations_;
  std::map<image_t, bool> rotation_converged_;
  std::map<image_t, double> sdp_optimality_;
  CoarsePoses result_;
  std::chrono::steady_clock::time_point step_start_;
};

}  // namespace

bool CoarsePoseOptions::IsValid(std::string* error) const {
  if (!(max_rotation_discrepancy_deg > 0.0)) {
    *error = "max_rotation_discrepancy_deg = " +
             std::to_string(max_rotation_discrepancy_deg) + " must be > 0";
    return false;
  }
  if (min_num_inliers < 0) {
    *error = "min_num_inliers = " + std::to_string(min_num_inliers) +
             " must be >= 0";
    return false;
  }
  if (!(min_known_length_m >= 0.0)) {
    *error = "min_known_length_m = " + std::to_string(min_known_length_m) +
             " must be >= 0";
    return false;
  }
  return chain.IsValid(error) && rotation_rates.IsValid(error) &&
         relative_poses.IsValid(error) && lengths.IsValid(error) &&
         loops.IsValid(error) && rotations.IsValid(error) &&
         translations.IsValid(error) && augmentation.IsValid(error) &&
         positions.IsValid(error) && position_filter.IsValid(error);
}

CoarsePoses EstimateCoarsePoses(const CoarsePoseOptions& options,
                                const ViewGraph& initial_graph,
                                const GlobalCorrespondences& correspondences,
                                const std::vector<RelativePosePrior>& priors) {
  std::string error;
  if (!options.IsValid(&error)) {
    throw std::invalid_argument("EstimateCoarsePoses: " + error);
  }
  initial_graph.Check();
  CoarsePoseOptions step_options = options;
  step_options.relative_poses.num_threads = options.num_threads;
  step_options.lengths.num_threads = options.num_threads;
  step_options.translations.num_threads = options.num_threads;
  return CoarsePoseEstimator(step_options, initial_graph, correspondences,
                             priors)
      .Run();
}

}  // namespace adasfm
