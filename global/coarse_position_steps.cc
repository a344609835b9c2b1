// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "global/coarse_pose_estimator.h"
#include "global/odometry/parts_of_one_unit.h"
#include "global/view_graph/directions_at_rest.h"

namespace adasfm {

void CoarsePoseEstimator::EstimateTranslations() {
  RelativeTranslationReport report;
  if (options_.translations.enabled) {
    report = EstimateRelativeTranslations(options_.translations, rotations_,
                                          correspondences_, &graph_);
    report.num_without_direction += DropDirectionsAtRest(&graph_);
  }
  const int num_augmented =
      AugmentTranslations(options_.augmentation, AllPriors(), &graph_);
  EndStep("relative translations",
          std::to_string(report.num_refined) + " refined, " +
              std::to_string(report.num_without_direction) +
              " without direction, " + std::to_string(num_augmented) +
              " from sensors");
}

void CoarsePoseEstimator::EstimatePositions() {
  lengths_ = EstimateLengths();
  const int num_at_rest = JoinAtRest();
  // Unit vectors throughout, as in the paper: shared points would reintroduce
  // metres.
  if (!options_.augmentation.use_metric_lengths) lengths_ = EdgeLengths();
  const int num_hinges = SplitWhereSizeIsUnknown(num_at_rest > 0);
  int num_images = 0;
  int num_iterations = 0;
  for (const std::vector<image_t>& images : FindDirectedComponents()) {
    num_iterations += EstimateComponent(images);
  }
  for (const CoarseComponent& component : result_.components) {
    num_images += component.cams_from_world.size();
  }
  const int num_removed = RemoveEdgesOffPositions();
  const int num_closures = ReportUnconfirmedClosures();
  EndStep(
      "translation averaging",
      std::to_string(num_images) + " images in " +
          std::to_string(result_.components.size()) +
          (result_.components.size() == 1 ? " component, " : " components, ") +
          std::to_string(num_iterations) + " iterations, " +
          std::to_string(num_removed) + " edges removed, " +
          std::to_string(num_hinges) + " between parts of unknown size, " +
          std::to_string(num_closures) + " joins at one place only, " +
          std::to_string(num_at_rest) + " pairs at rest join others");
}

// Components by edges with a direction; images without one are components of
// their own.
std::vector<std::vector<image_t>>
CoarsePoseEstimator::FindComponentsByDirection() const {
  ViewGraph directed = graph_;
  for (ViewGraphEdge& edge : directed.edges) {
    if (!edge.has_translation) edge.removal = EdgeRemoval::kTranslation;
  }
  return FindConnectedComponents(directed);
}

// A camera at rest sees no direction. Where nothing else joins two components,
// the images of such a pair are at one place, unless the odometry says that the
// machine moved. Returns the number of pairs.
int CoarsePoseEstimator::JoinAtRest() {
  std::map<image_t, size_t> component_of;
  const auto components = FindComponentsByDirection();
  for (size_t k = 0; k < components.size(); ++k) {
    for (const image_t image_id : components[k]) component_of[image_id] = k;
  }
  int num_joins = 0;
  for (size_t e = 0; e < graph_.edges.size(); ++e) {
    ViewGraphEdge& edge = graph_.edges[e];
    if (!edge.IsAtOnePlace() || !lengths_.is_at_known_depth[e] ||
        component_of.at(edge.image_id1) == component_of.at(edge.image_id2) ||
        OdometryMoves(edge)) {
      continue;
    }
    edge.has_translation = true;
    edge.cam2_from_cam1.translation.setZero();
    ++num_joins;
  }
  return num_joins;
}

bool CoarsePoseEstimator::OdometryMoves(const ViewGraphEdge& edge) const {
  constexpr double kMaxSigmas = 5.0;
  // What vision may overlook.
  constexpr double kMinSigmaM = 0.05;
  if (!chain_.IsConnected(edge.image_id1, edge.image_id2)) return false;
  const ChainMotion motion = chain_.Motion(edge.image_id1, edge.image_id2);
  if (!motion.has_position) return false;
  const Eigen::Matrix3d covariance =
      motion.covariance.bottomRightCorner<3, 3>() +
      kMinSigmaM * kMinSigmaM * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d& step = motion.cam2_from_cam1.translation;
  return step.dot(covariance.ldlt().solve(step)) > kMaxSigmas * kMaxSigmas;
}

// Of at least two images each.
std::vector<std::vector<image_t>> CoarsePoseEstimator::FindDirectedComponents()
    const {
  std::vector<std::vector<image_t>> components = FindComponentsByDirection();
  while (!components.empty() && components.back().size() < 2) {
    components.pop_back();
  }
  return components;
}

GlobalPositions CoarsePoseEstimator::EstimatePositionsOf(
    const std::vector<image_t>& images) const {
  const ViewGraph subgraph = ExtractSubgraph(graph_, images);
  return EstimateGlobalPositions(options_.positions, subgraph, rotations_,
                                 SelectLengths(subgraph),
                                 StartFromChain(images));
}

// With metres everywhere, all parts have one scale.
bool CoarsePoseEstimator::HasMetresEverywhere() const {
  std::vector<bool> has_metres(graph_.images.size(), false);
  for (const ViewGraphEdge& edge : graph_.edges) {
    if (!edge.IsKept() || !edge.length_m) continue;
    has_metres[graph_.IndexOf(edge.image_id1)] = true;
    has_metres[graph_.IndexOf(edge.image_id2)] = true;
  }
  return std::all_of(has_metres.begin(), has_metres.end(),
                     [](bool has) { return has; });
}

// Returns the number of edges removed.
int CoarsePoseEstimator::SplitWhereSizeIsUnknown(bool has_joins_at_rest) {
  // Photos in any order have no segments to keep apart.
  const bool has_segments = result_.loop_closures.segments_were_split;
  if ((!has_segments && !has_joins_at_rest) || lengths_.lengths.empty() ||
      HasMetresEverywhere()) {
    return 0;
  }
  std::map<image_t, Eigen::Vector3d> centers;
  for (const std::vector<image_t>& images : FindDirectedComponents()) {
    const GlobalPositions positions = EstimatePositionsOf(images);
    centers.insert(positions.centers.begin(), positions.centers.end());
  }
  const std::vector<int> part_of = FindPartsOfOneUnit(
      graph_,
      FindLengthUnits(options_.num_threads, graph_, KnownLengths(),
                      correspondences_, lengths_),
      centers);
  int num_removed = 0;
  for (ViewGraphEdge& edge : graph_.edges) {
    if (!edge.IsKept() || (!has_segments && !edge.IsJoinAtRest()) ||
        part_of[graph_.IndexOf(edge.image_id1)] ==
            part_of[graph_.IndexOf(edge.image_id2)]) {
      continue;
    }
    edge.removal = EdgeRemoval::kUnknownSize;
    ++num_removed;
  }
  return num_removed;
}

// Reports closures that were made unconfirmed, with their component. Returns
// their number.
int CoarsePoseEstimator::ReportUnconfirmedClosures() {
  // Smaller segments do not count as parts of a drive.
  constexpr int kMinNumImages = 10;
  int num_closures = 0;
  if (result_.loop_closures.segments_were_split) return num_closures;
  for (const SegmentClosure& closure :
       result_.loop_closures.unconfirmed_closures) {
    if (closure.num_images < kMinNumImages) continue;
    for (CoarseComponent& component : result_.components) {
      if (component.cams_from_world.count(closure.image_id1) &&
          component.cams_from_world.count(closure.image_id2)) {
        component.unconfirmed_closures.push_back(closure);
        ++num_closures;
      }
    }
  }
  return num_closures;
}

// Returns the number of iterations.
int CoarsePoseEstimator::EstimateComponent(const std::vector<image_t>& images) {
  const GlobalPositions positions = EstimatePositionsOf(images);
  if (!positions.success) return positions.num_iterations;
  CoarseComponent component;
  component.metric = positions.metric;
  component.rotations_converged = rotation_converged_.at(images.front());
  component.sdp_optimality = sdp_optimality_.at(images.front());
  for (const image_t image_id : images) {
    component.cams_from_world[image_id] = CamFromWorldWithCenter(
        rotations_.at(image_id), positions.centers.at(image_id));
  }
  component.positions_converged = positions.converged;
  result_.components.push_back(std::move(component));
  return positions.num_iterations;
}

int CoarsePoseEstimator::RemoveEdgesOffPositions() {
  std::map<image_t, Eigen::Vector3d> centers;
  std::map<image_t, size_t> component_of;
  for (size_t k = 0; k < result_.components.size(); ++k) {
    for (const auto& [image_id, pose] : result_.components[k].cams_from_world) {
      centers[image_id] = pose.TargetOriginInSource();
      component_of[image_id] = k;
    }
  }
  int num_removed = 0;
  for (ViewGraphEdge& edge : graph_.edges) {
    if (!edge.IsKept()) continue;
    const auto component1 = component_of.find(edge.image_id1);
    const auto component2 = component_of.find(edge.image_id2);
    if (component1 == component_of.end() || component2 == component_of.end() ||
        component1->second != component2->second) {
      edge.removal = EdgeRemoval::kDisconnected;
      ++num_removed;
    }
  }
  // Lengths and positions have one unit only when both are metres.
  auto lengths = lengths_.lengths;
  for (size_t e = 0; e < lengths.size(); ++e) {
    const auto component = component_of.find(graph_.edges[e].image_id1);
    const bool has_metres = lengths_.metric &&
                            component != component_of.end() &&
                            result_.components[component->second].metric &&
                            !(lengths[e] && lengths[e]->is_by_depth);
    if (!has_metres) lengths[e].reset();
  }
  return num_removed +
         FilterEdgesByPosition(rotations_, centers, lengths, &graph_);
}

// Metres of the priors that augment the graph, spread through shared points.
EdgeLengths CoarsePoseEstimator::EstimateLengths() const {
  return EstimateEdgeLengths(options_.num_threads, graph_, KnownLengths(),
                             correspondences_, lengths_);
}

std::map<ImagePair, double> CoarsePoseEstimator::KnownLengths() const {
  // Shorter motions (standstill) do not constrain depths.
  constexpr double kMinLengthM = 0.05;
  std::map<ImagePair, double> known_lengths_m;
  for (const RelativePosePrior& prior : AllPriors()) {
    const double length = prior.cam2_from_cam1.translation.norm();
    if (prior.HasLength() && length >= kMinLengthM &&
        IsKnownMotion(options_.augmentation, prior)) {
      known_lengths_m[ImagePair(prior.image_id1, prior.image_id2)] = length;
    }
  }
  return known_lengths_m;
}

std::vector<std::optional<EdgeLength>> CoarsePoseEstimator::SelectLengths(
    const ViewGraph& subgraph) const {
  std::vector<std::optional<EdgeLength>> selected;
  if (lengths_.lengths.empty()) return selected;
  const bool metric = std::any_of(
      subgraph.edges.begin(), subgraph.edges.end(),
      [](const ViewGraphEdge& edge) {
        return edge.IsKept() && edge.has_translation && edge.length_m;
      });
  size_t e = 0;
  for (const ViewGraphEdge& edge : subgraph.edges) {
    while (graph_.edges[e].Pair() < edge.Pair()) ++e;
    selected.push_back(lengths_.lengths[e]);
    // Lengths guessed by depth are not used beside metres.
    if (metric && selected.back() && selected.back()->is_by_depth) {
      selected.back().reset();
    }
  }
  return selected;
}

// The chain's translations under the global rotations; empty unless they reach
// all images.
std::map<image_t, Eigen::Vector3d> CoarsePoseEstimator::StartFromChain(
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

}  // namespace adasfm
