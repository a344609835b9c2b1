// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/global_stage.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <sstream>
#include <stdexcept>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

// One number of threads for all steps but the adjustment, whose own option says
// why.
GlobalStageOptions WithThreads(GlobalStageOptions options) {
  options.two_view.num_threads = options.num_threads;
  options.poses.num_threads = options.num_threads;
  options.structure.triangulation.num_threads = options.num_threads;
  options.refinement.num_threads = options.num_threads;
  return options;
}

GlobalCorrespondences FindCorrespondences(const SceneData& scene,
                                          int num_threads) {
  GlobalCorrespondences correspondences;
  std::vector<const SceneImage*> images;
  for (const auto& [image_id, image] : scene.images) {
    correspondences.bearings[image_id];
    images.push_back(&image);
  }
  ParallelFor(num_threads, images.size(), [&](size_t i) {
    correspondences.bearings.at(images[i]->image_id) = ComputeBearings(
        scene.cameras.at(images[i]->camera_id), images[i]->keypoints);
  });
  for (const ScenePair& pair : scene.pairs) {
    correspondences.matches[ImagePair(pair.image_id1, pair.image_id2)] =
        pair.inlier_matches;
  }
  return correspondences;
}

// The matches of the edges that hold the component together.
CoarseModelInput CreateModelInput(const CoarseComponent& component,
                                  const CoarsePoses& poses,
                                  const GlobalCorrespondences& matches) {
  CoarseModelInput input;
  input.priors = poses.priors;
  input.cams_from_world = component.cams_from_world;
  input.metric = component.metric;
  for (const ViewGraphEdge& edge : poses.graph.edges) {
    if (!edge.IsKept() || edge.source == EdgeSource::kSensor) continue;
    if (component.cams_from_world.count(edge.image_id1) == 0 ||
        component.cams_from_world.count(edge.image_id2) == 0) {
      continue;
    }
    const auto it = matches.matches.find(edge.Pair());
    if (it != matches.matches.end()) input.matches.insert(*it);
  }
  return input;
}

// Before it is used.
std::string DescribeTrackMemory(const CoarseModelInput& input) {
  std::ostringstream text;
  text << "structure, tracks take at most "
       << (EstimateTrackBytes(input.matches) >> 20) + 1 << " MiB";
  return text.str();
}

std::string DescribeModel(const CoarseModel& model) {
  std::ostringstream text;
  text.precision(3);
  text << model.reconstruction.NumRegImages() << " images, " << model.num_points
       << " points, " << model.num_observations << " observations, "
       << model.mean_reproj_error_px << " px, angles >= " << model.min_angle_deg
       << " deg";
  if (model.num_images_without_points > 0) {
    text << ", " << model.num_images_without_points << " images without points";
  }
  for (const PriorBundleAdjustmentSummary& round : model.rounds) {
    if (!round.success) text << ", adjustment failed: " << round.message;
  }
  return text.str();
}

// Pairs whose matches show another place than the poses say. Refinement cannot
// tell: two look-alike places on one straight street differ only by a motion
// along the line of sight, which leaves their matches on the epipolar lines.
std::set<ImagePair> FindRefutedPairs(const ViewGraph& graph) {
  std::set<ImagePair> refuted;
  for (const ViewGraphEdge& edge : graph.edges) {
    switch (edge.removal) {
      case EdgeRemoval::kOdometryRotation:
      case EdgeRemoval::kOdometryPosition:
      case EdgeRemoval::kFalseLoop:
      case EdgeRemoval::kRotation:
      case EdgeRemoval::kTranslation:
        refuted.insert(edge.Pair());
        break;
      case EdgeRemoval::kKept:
      case EdgeRemoval::kFewInliers:
      case EdgeRemoval::kRelativePose:
      case EdgeRemoval::kDisconnected:
        break;
    }
  }
  return refuted;
}

// Refines the pairs within every model, in the frame of the model's poses.
void RefinePairs(const MatchRefinementOptions& options, const SceneData& scene,
                 const GlobalCorrespondences& correspondences,
                 GlobalStageResult* result) {
  std::map<image_t, int> component_of;
  for (size_t i = 0; i < result->models.size(); ++i) {
    for (const image_t id : result->models[i].reconstruction.RegImageIds()) {
      component_of[id] = static_cast<int>(i);
    }
  }
  std::vector<std::map<ImagePair, std::vector<FeatureMatch>>> candidates(
      result->models.size());
  const std::set<ImagePair> refuted = FindRefutedPairs(result->poses.graph);
  for (const ScenePair& pair : scene.pairs) {
    const auto it1 = component_of.find(pair.image_id1);
    const auto it2 = component_of.find(pair.image_id2);
    if (it1 == component_of.end() || it2 == component_of.end()) {
      ++result->refinement.num_skipped_pairs;
    } else if (refuted.count(ImagePair(pair.image_id1, pair.image_id2))) {
      result->removed_pairs.emplace_back(pair.image_id1, pair.image_id2);
    } else if (it1->second == it2->second) {
      candidates[it1->second][ImagePair(pair.image_id1, pair.image_id2)] =
          pair.raw_matches.empty() ? pair.inlier_matches : pair.raw_matches;
    } else {
      // The view graph found no consistent way to join the two components.
      result->removed_pairs.emplace_back(pair.image_id1, pair.image_id2);
    }
  }
  for (size_t i = 0; i < result->models.size(); ++i) {
    const MatchRefinementReport report =
        RefineMatches(options, CamsFromWorld(result->models[i].reconstruction),
                      correspondences.bearings, candidates[i]);
    MatchRefinementReport& total = result->refinement;
    total.pairs.insert(total.pairs.end(), report.pairs.begin(),
                       report.pairs.end());
    total.num_removed_pairs += report.num_removed_pairs;
    total.num_candidates += report.num_candidates;
    total.num_kept += report.num_kept;
  }
}

// The refined pairs as new rows and removals.
void CollectGeometries(GlobalStageResult* result) {
  for (const RefinedPair& pair : result->refinement.pairs) {
    if (pair.removed) {
      result->removed_pairs.push_back(pair.pair);
    } else if (pair.cam2_from_cam1.translation.norm() > 0.0) {
      result->geometries.push_back(
          {pair.pair, pair.matches, pair.cam2_from_cam1});
    }
  }
  std::sort(result->removed_pairs.begin(), result->removed_pairs.end());
  std::sort(result->geometries.begin(), result->geometries.end(),
            [](const auto& a, const auto& b) { return a.pair < b.pair; });
}

}  // namespace

bool GlobalStageOptions::IsValid(std::string* error) const {
  return two_view.IsValid(error) && poses.IsValid(error) &&
         structure.IsValid(error) && refinement.IsValid(error);
}

StatusOr<GlobalStageResult> RunGlobalStage(
    const GlobalStageOptions& requested_options, const SceneData& scene,
    const StageProgress& progress) {
  std::string error;
  if (!requested_options.IsValid(&error)) throw std::invalid_argument(error);
  const GlobalStageOptions options = WithThreads(requested_options);
  const auto begin = [&](const std::string& name, double share_done) {
    if (progress) progress(name, share_done);
    return Stopwatch();
  };
  GlobalStageResult result;

  // 1. View graph.
  Stopwatch watch = begin("view graph", 0.0);
  const GlobalCorrespondences correspondences =
      FindCorrespondences(scene, options.num_threads);
  const InitialViewGraph initial =
      BuildInitialViewGraph(options.two_view, scene, correspondences.bearings);
  std::ostringstream text;
  text << initial.graph.images.size() << " images, "
       << initial.graph.edges.size() << " pairs: " << initial.num_stored_poses
       << " poses stored, " << initial.num_decomposed << " decomposed, "
       << initial.num_reestimated << " estimated anew, "
       << initial.num_without_pose << " without";
  result.steps.push_back({"view graph", watch.Seconds(), text.str()});

  // 2-6. Coarse poses.
  begin("coarse poses", 0.1);
  result.poses = EstimateCoarsePoses(options.poses, initial.graph,
                                     correspondences, scene.priors);
  for (const CoarseStep& step : result.poses.steps) {
    result.steps.push_back({step.name, step.seconds, step.summary});
  }
  if (result.poses.components.empty()) {
    return Status::Error(
        "no two images hold together: the database has no verified pairs with "
        "a relative pose and no usable priors; match the images first");
  }

  // 7. Structure and adjustment.
  for (const CoarseComponent& component : result.poses.components) {
    const CoarseModelInput input =
        CreateModelInput(component, result.poses, correspondences);
    watch = begin(DescribeTrackMemory(input), 0.5);
    result.models.push_back(BuildCoarseModel(options.structure, scene,
                                             correspondences.bearings, input));
    result.steps.push_back(
        {"structure", watch.Seconds(), DescribeModel(result.models.back())});
  }

  // 8. Match refinement.
  if (options.refinement.enabled) {
    watch = begin("match refinement", 0.9);
    RefinePairs(options.refinement, scene, correspondences, &result);
    CollectGeometries(&result);
    text.str("");
    text << result.refinement.num_kept << " of "
         << result.refinement.num_candidates << " matches in "
         << result.geometries.size() << " pairs, "
         << result.removed_pairs.size() << " pairs removed, "
         << result.refinement.num_skipped_pairs << " left as they were";
    result.steps.push_back({"match refinement", watch.Seconds(), text.str()});
  }
  return result;
}

}  // namespace adasfm
