// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_stage.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <stdexcept>

#include "colmap_ext/coarse/join_models.h"
#include "colmap_ext/coarse/measure_size.h"
#include "colmap_ext/coarse/refine_stage_matches.h"
#include "colmap_ext/coarse/split_models.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "core/option_checker.h"
#include "core/release_memory.h"
#include "core/so3.h"
#include "core/stopwatch.h"

namespace adasfm {
namespace {

// One number of threads for all steps but the adjustment, whose own option says
// why.
GlobalStageOptions WithThreads(GlobalStageOptions options) {
  options.focal_lengths.num_threads = options.num_threads;
  options.two_view.num_threads = options.num_threads;
  options.poses.num_threads = options.num_threads;
  options.structure.triangulation.num_threads = options.num_threads;
  options.refinement.num_threads = options.num_threads;
  return options;
}

GlobalCorrespondences FindCorrespondences(const SceneData& scene,
                                          int num_threads) {
  GlobalCorrespondences correspondences;
  correspondences.bearings = ComputeSceneBearings(scene, num_threads);
  for (const ScenePair& pair : scene.pairs) {
    correspondences.matches[ImagePair(pair.image_id1, pair.image_id2)] =
        pair.inlier_matches;
  }
  return correspondences;
}

std::string DescribeViewGraph(const InitialViewGraph& initial) {
  std::ostringstream text;
  text << initial.graph.images.size() << " images, "
       << initial.graph.edges.size() << " pairs: " << initial.num_stored_poses
       << " poses stored, " << initial.num_decomposed << " decomposed, "
       << initial.num_reestimated << " estimated anew, "
       << initial.num_without_pose << " without";
  return text.str();
}

Status NothingHoldsTogether() {
  return Status::Error(
      "no two images hold together: the database has no verified pairs with "
      "a relative pose and no usable priors; match the images first");
}

// What two-view verification took for the motion of a pair was that of
// something else, as of cars that carry most of its matches: those of its raw
// matches that agree with the poses.
std::map<ImagePair, std::vector<FeatureMatch>> MatchAnew(
    const MatchRefinementOptions& options, const SceneData& scene,
    const RawMatchSource& raw_matches,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const CoarseComponent& component, const ViewGraph& graph) {
  if (!options.enabled) return {};
  std::set<ImagePair> refuted;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (edge.removal == EdgeRemoval::kOdometryPose) refuted.insert(edge.Pair());
  }
  std::vector<const ScenePair*> pairs;
  for (const ScenePair& pair : scene.pairs) {
    if (refuted.count(ImagePair(pair.image_id1, pair.image_id2)) > 0) {
      pairs.push_back(&pair);
    }
  }
  MatchRefinementReport report;
  RefineRawMatches(options, raw_matches, component.cams_from_world, bearings,
                   pairs, &report);
  std::map<ImagePair, std::vector<FeatureMatch>> matched;
  for (RefinedPair& pair : report.pairs) {
    if (!pair.removed) matched[pair.pair] = std::move(pair.matches);
  }
  return matched;
}

// The matches of the edges that hold the component together, taken out of the
// correspondences, and those of pairs that are matched anew.
CoarseModelInput CreateModelInput(
    std::map<ImagePair, std::vector<FeatureMatch>> matched_anew,
    const CoarseComponent& component, const CoarsePoses& poses,
    GlobalCorrespondences* correspondences) {
  CoarseModelInput input;
  input.priors = poses.priors;
  if (poses.camera_mount.corrected) {
    input.camera_mount = ExpSo3(poses.camera_mount.turn_rad);
  }
  input.cams_from_world = component.cams_from_world;
  input.metric = component.metric;
  input.matches = std::move(matched_anew);
  for (const ViewGraphEdge& edge : poses.graph.edges) {
    if (!edge.IsKept() || edge.source == EdgeSource::kSensor) continue;
    if (component.cams_from_world.count(edge.image_id1) == 0 ||
        component.cams_from_world.count(edge.image_id2) == 0) {
      continue;
    }
    input.matches.insert(correspondences->matches.extract(edge.Pair()));
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

std::string DescribeMatches(const GlobalStageResult& result) {
  std::ostringstream text;
  text << result.refinement.num_kept << " of "
       << result.refinement.num_candidates << " matches in "
       << result.geometries.size() << " pairs, " << result.removed_pairs.size()
       << " pairs removed, " << result.refinement.num_skipped_pairs
       << " left as they were";
  return text.str();
}

void MeasureSizes(const SceneData& scene, GlobalStageResult* result) {
  for (CoarseModel& model : result->models) {
    const std::vector<InertialLength> lengths =
        MeasureSize(scene, result->poses.camera_mount, &model);
    result->inertial_lengths.insert(result->inertial_lengths.end(),
                                    lengths.begin(), lengths.end());
  }
}

std::string DescribeSizes(const GlobalStageResult& result) {
  std::ostringstream text;
  text.precision(2);
  for (const CoarseModel& model : result.models) {
    text << (text.tellp() > 0 ? ", " : "");
    if (model.inertial_scale_sigma > 0.0) {
      text << "to " << 100.0 * model.inertial_scale_sigma << " %";
    } else {
      text << (model.metric ? "not needed" : "none");
    }
  }
  return text.str();
}

}  // namespace

bool GlobalStageOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmGlobal", error)
             .Positive("pose_prior_sigma", pose_prior_sigma)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .PositiveOrMinusOne("num_threads", num_threads)
             .AllHold() &&
         focal_lengths.IsValid(error) && two_view.IsValid(error) &&
         poses.IsValid(error) && structure.IsValid(error) &&
         refinement.IsValid(error);
}

StatusOr<GlobalStageResult> RunGlobalStage(
    const GlobalStageOptions& requested_options, SceneData* mutable_scene,
    const StageProgress& progress, RawMatchSource raw_matches) {
  if (!raw_matches) raw_matches = RawMatchesOfScene(*mutable_scene);
  std::string error;
  if (!requested_options.IsValid(&error)) throw std::invalid_argument(error);
  const GlobalStageOptions options = WithThreads(requested_options);
  const auto begin = [&](const std::string& name, double share_done) {
    if (progress) progress(name, share_done);
    return Stopwatch();
  };
  GlobalStageResult result;

  // 2.0 Focal lengths.
  Stopwatch watch = begin("focal lengths", 0.0);
  result.focal_lengths =
      CalibrateFocalLengths(options.focal_lengths, mutable_scene);
  const SceneData& scene = *mutable_scene;
  result.steps.push_back({"focal lengths", watch.Seconds(),
                          std::to_string(result.focal_lengths.size()) +
                              " found of " +
                              std::to_string(scene.cameras.size())});

  // 2.1 View graph.
  watch = begin("view graph", 0.0);
  GlobalCorrespondences correspondences =
      FindCorrespondences(scene, options.num_threads);
  const InitialViewGraph initial =
      BuildInitialViewGraph(options.two_view, scene, correspondences.bearings);
  result.steps.push_back(
      {"view graph", watch.Seconds(), DescribeViewGraph(initial)});

  // 2.1-2.6 Coarse poses.
  begin("coarse poses", 0.1);
  CoarsePoseOptions pose_options = options.poses;
  pose_options.chain.gyro_bias_covariance = scene.gyroscope_bias_covariance;
  result.poses =
      EstimateCoarsePoses(pose_options, initial.graph, correspondences,
                          scene.priors, scene.frame_priors);
  result.steps.insert(result.steps.end(), result.poses.steps.begin(),
                      result.poses.steps.end());
  if (result.poses.components.empty()) return NothingHoldsTogether();
  ReleaseFreedMemory();

  // 2.7 Structure and adjustment.
  CoarseStructureOptions structure_options = options.structure;
  structure_options.bundle.shared_errors.length_drift_ratio =
      scene.length_drift_ratio;
  const std::map<ImagePair, std::vector<FeatureMatch>> all_matches =
      result.poses.components.size() > 1 || !result.poses.components[0].metric
          ? correspondences.matches
          : std::map<ImagePair, std::vector<FeatureMatch>>();
  for (const CoarseComponent& component : result.poses.components) {
    CoarseModelInput input = CreateModelInput(
        MatchAnew(options.refinement, scene, raw_matches,
                  correspondences.bearings, component, result.poses.graph),
        component, result.poses, &correspondences);
    input.refine_lenses = options.structure.refine_unknown_focal_length &&
                          !result.focal_lengths.empty();
    watch = begin(DescribeTrackMemory(input), 0.5);
    result.models.push_back(BuildCoarseModel(
        structure_options, scene, correspondences.bearings, std::move(input)));
    result.steps.push_back(
        {"structure", watch.Seconds(), DescribeModel(result.models.back())});
  }
  const int num_split = SplitModels(options, scene, correspondences.bearings,
                                    all_matches, &result);
  if (result.models.size() > 1) {
    watch = begin("joins of models", 0.85);
    const int num_joins = JoinModels(options, scene, correspondences.bearings,
                                     all_matches, &result);
    if (num_split > 0 || num_joins > 0) SortModels(&result);
    result.steps.push_back({"joins of models", watch.Seconds(),
                            std::to_string(num_joins) +
                                " of parts whose points tell their size, " +
                                std::to_string(num_split) +
                                " parts taken out that no points tie or "
                                "that the accelerometer puts elsewhere"});
  }
  MeasurePairAgreements(options, scene, correspondences.bearings, &result);

  // 2.8 Match refinement.
  correspondences.matches.clear();
  ReleaseFreedMemory();
  if (options.refinement.enabled) {
    watch = begin("match refinement", 0.9);
    RefineStageMatches(options, scene, raw_matches, correspondences.bearings,
                       &result);
    result.steps.push_back(
        {"match refinement", watch.Seconds(), DescribeMatches(result)});
  }

  // 2.9 Metres without wheels.
  if (!scene.inertial_motions.empty() &&
      std::any_of(result.models.begin(), result.models.end(),
                  [](const CoarseModel& model) { return !model.metric; })) {
    watch = begin("metres from the accelerometer", 0.95);
    MeasureSizes(scene, &result);
    result.steps.push_back({"metres from the accelerometer", watch.Seconds(),
                            DescribeSizes(result)});
  }
  return result;
}

}  // namespace adasfm
