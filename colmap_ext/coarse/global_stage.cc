// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_stage.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "colmap_ext/coarse/find_sensor_corrections.h"
#include "colmap_ext/coarse/join_models.h"
#include "colmap_ext/coarse/measure_size.h"
#include "colmap_ext/coarse/model_input.h"
#include "colmap_ext/coarse/refine_stage_matches.h"
#include "colmap_ext/coarse/split_models.h"
#include "colmap_ext/coarse/stage_summaries.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/drives.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "colmap_ext/scene/untied_parts.h"
#include "core/option_checker.h"
#include "core/prior_lengths.h"
#include "core/so3.h"
#include "core/stopwatch.h"
#include "global/odometry/bridge_gaps.h"

namespace adasfm {
namespace {

// Sets what several steps share: threads (the adjustment has its own option),
// the memory budget, and the error that the scene's lengths share.
GlobalStageOptions SetSharedOptions(GlobalStageOptions options,
                                    const SceneData& scene) {
  options.focal_lengths.num_threads = options.num_threads;
  options.poses.num_threads = options.num_threads;
  options.structure.triangulation.num_threads = options.num_threads;
  options.refinement.num_threads = options.num_threads;
  PriorBundleAdjustmentOptions& bundle = options.structure.bundle;
  bundle.max_memory_gb = options.max_memory_gb;
  bundle.shared_errors.length_drift_ratio = scene.length_drift_ratio;
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

Status NothingHoldsTogether() {
  return Status::Error(
      "no two images hold together: the database has no verified pairs with "
      "a relative pose and no usable priors; match the images first");
}

// Least ratio of the kept visual pairs with bridged gaps to those without. Of
// 38 drives with gaps correct odometry kept 0.98 or more; wrong odometry on a
// phone's walk kept 0.28.
constexpr double kMinKeptRatio = 0.9;

std::map<image_t, Rigid3d> PosesHeldByPoints(
    const colmap::Reconstruction& reconstruction) {
  std::map<image_t, Rigid3d> poses;
  for (const auto& [image_id, pose] : CamsFromWorld(reconstruction)) {
    if (reconstruction.Image(image_id).NumPoints3D() >= kMinNumPointsOfPose) {
      poses.emplace(image_id, pose);
    }
  }
  return poses;
}

size_t NumImagesOfLargest(const GlobalStageResult& result) {
  size_t num_images = 0;
  for (const CoarseModel& model : result.models) {
    num_images =
        std::max<size_t>(num_images, model.reconstruction.NumRegImages());
  }
  return num_images;
}

// Does not count edges of sensors.
size_t NumKeptPairs(const GlobalStageResult& result) {
  const std::vector<ViewGraphEdge>& edges = result.poses.graph.edges;
  return std::count_if(
      edges.begin(), edges.end(), [](const ViewGraphEdge& edge) {
        return edge.IsKept() && edge.source != EdgeSource::kSensor;
      });
}

std::string DescribeLargest(const GlobalStageResult& result) {
  return std::to_string(NumImagesOfLargest(result)) + " images, of " +
         std::to_string(NumKeptPairs(result)) + " pairs in all";
}

// New matches for pairs whose two-view verification found the motion of
// something else, as of cars with most of the matches: the raw matches that
// agree with the poses.
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

// Moves the matches of the component's edges from the correspondences.
void TakeMatches(const CoarseComponent& component, const ViewGraph& graph,
                 GlobalCorrespondences* correspondences,
                 std::map<ImagePair, std::vector<FeatureMatch>>* matches) {
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || edge.source == EdgeSource::kSensor) continue;
    if (component.cams_from_world.count(edge.image_id1) == 0 ||
        component.cams_from_world.count(edge.image_id2) == 0) {
      continue;
    }
    matches->insert(correspondences->matches.extract(edge.Pair()));
  }
}

class GlobalStage {
 public:
  GlobalStage(const GlobalStageOptions& options, const StageProgress& progress,
              RawMatchSource raw_matches, SceneData* scene)
      : options_(options),
        progress_(progress),
        raw_matches_(std::move(raw_matches)),
        scene_(*scene) {}

  StatusOr<GlobalStageResult> Run() {
    CalibrateLenses();
    BuildViewGraph();
    EstimateModels(scene_.priors);
    if (result_.models.empty()) return NothingHoldsTogether();
    CorrectTimeShifts();
    CorrectScales();
    EstimateModelsAcrossGaps();
    Join();
    MeasurePairAgreements(options_, scene_, correspondences_.bearings,
                          &result_);
    correspondences_.matches.clear();
    RefineAllMatches();
    MeasureSizes();
    return std::move(result_);
  }

 private:
  static CameraImuCorrectionMap CorrectionsOf(const GlobalStageResult& result) {
    return CameraImuCorrections(result.poses.camera_imu_rotations);
  }

  // The priors of a result are rotated already.
  void RotateScene(const CameraImuCorrectionMap& corrections) {
    RotateGravityAndMotions(corrections, &scene_);
  }

  void Begin(const std::string& name, double share_done) {
    if (progress_) progress_(name, share_done);
    watch_ = Stopwatch();
  }

  void End(const std::string& name, const std::string& summary) {
    result_.steps.push_back({name, watch_.Seconds(), summary});
  }

  // 2.0
  void CalibrateLenses() {
    Begin("focal lengths", 0.0);
    result_.focal_lengths =
        CalibrateFocalLengths(options_.focal_lengths, &scene_);
    End("focal lengths", std::to_string(result_.focal_lengths.size()) +
                             " found of " +
                             std::to_string(scene_.cameras.size()));
  }

  // 2.1
  void BuildViewGraph() {
    Begin("view graph", 0.0);
    correspondences_ = FindCorrespondences(scene_, options_.num_threads);
    initial_ = BuildInitialViewGraph(scene_, correspondences_.bearings,
                                     options_.num_threads);
    End("view graph", DescribeViewGraph(initial_));
  }

  // 2.1-2.7
  void EstimateModels(const std::vector<RelativePosePrior>& priors) {
    Begin("coarse poses", 0.1);
    CoarsePoseOptions pose_options = options_.poses;
    pose_options.chain.gyro_bias_covariance = scene_.gyroscope_bias_covariance;
    result_.poses =
        EstimateCoarsePoses(pose_options, initial_.graph, correspondences_,
                            priors, scene_.frame_priors);
    RotateScene(CorrectionsOf(result_));
    result_.steps.insert(result_.steps.end(), result_.poses.steps.begin(),
                         result_.poses.steps.end());
    const std::vector<CoarseComponent>& components = result_.poses.components;
    if (components.size() > 1 ||
        (!components.empty() && !components[0].metric)) {
      all_matches_ = correspondences_.matches;
    }
    for (const CoarseComponent& component : components) BuildModel(component);
    num_split_ = SplitModels(options_, scene_, correspondences_.bearings,
                             all_matches_, &result_);
  }

  // 2.7
  void BuildModel(const CoarseComponent& component) {
    CoarseModelInput input =
        CreateModelInput(options_, result_, component.cams_from_world);
    input.metric = component.metric;
    input.matches =
        MatchAnew(options_.refinement, scene_, raw_matches_,
                  correspondences_.bearings, component, result_.poses.graph);
    TakeMatches(component, result_.poses.graph, &correspondences_,
                &input.matches);
    Begin(DescribeTrackMemory(input), 0.5);
    result_.models.push_back(BuildCoarseModel(options_.structure, scene_,
                                              correspondences_.bearings,
                                              std::move(input)));
    End("structure", DescribeModel(result_.models.back()));
  }

  void CorrectTimeShifts() {
    result_.time_shifts = FindTimeShifts(result_.models);
    if (result_.time_shifts.empty()) return;
    Begin("clocks of the cameras", 0.8);
    AddTimeShifts(result_.time_shifts, &result_.poses.priors,
                  &scene_.inertial_motions);
    End("clocks of the cameras", DescribeTimeShifts(result_.time_shifts));
  }

  void CorrectScales() {
    result_.gyroscope_scales = FindGyroscopeScales(result_.models);
    if (result_.gyroscope_scales.empty()) return;
    Begin("scales of the gyroscopes", 0.8);
    CorrectGyroscopeScales(result_.gyroscope_scales, &result_.poses.priors);
    End("scales of the gyroscopes",
        DescribeGyroscopeScales(result_.gyroscope_scales));
  }

  // Estimates the models again where the accelerometer alone gives the metres
  // and the way between parts of a drive: odometry then checks the loop
  // closures between parts, too.
  void EstimateModelsAcrossGaps() {
    if (scene_.inertial_motions.empty() || HasLengths(scene_.priors) ||
        HasLengths(scene_.frame_priors) || !scene_.positions.empty()) {
      return;
    }
    Begin("gaps", 0.8);
    std::vector<std::map<image_t, Rigid3d>> models;
    for (const CoarseModel& model : result_.models) {
      models.push_back(PosesHeldByPoints(model.reconstruction));
    }
    InertialOdometry odometry =
        BridgeGaps(scene_.inertial_motions, result_.poses.priors, models);
    End("gaps", std::to_string(odometry.num_gaps) +
                    " bridged by the accelerometer, over " +
                    std::to_string(odometry.bridges.size()) + " steps");
    if (odometry.num_gaps == 0) return;
    const CameraImuCorrectionMap back = Inverted(CorrectionsOf(result_));
    RotatePriors(back, &odometry.priors);
    RotateScene(back);
    GlobalStageResult in_parts = std::move(result_);
    const int num_split = num_split_;
    result_ = GlobalStageResult();
    result_.focal_lengths = in_parts.focal_lengths;
    result_.time_shifts = in_parts.time_shifts;
    result_.gyroscope_scales = in_parts.gyroscope_scales;
    result_.steps = in_parts.steps;
    correspondences_.matches = all_matches_;
    EstimateModels(odometry.priors);
    if (IsBetterAcrossGaps(in_parts, result_)) {
      result_.bridges = std::move(odometry.bridges);
      return;
    }
    Begin("gaps", 0.85);
    End("gaps", "left open: with them bridged the largest model has " +
                    DescribeLargest(result_) + ", without " +
                    DescribeLargest(in_parts));
    RotateScene(Inverted(CorrectionsOf(result_)));
    RotateScene(CorrectionsOf(in_parts));
    in_parts.steps = std::move(result_.steps);
    result_ = std::move(in_parts);
    num_split_ = num_split;
  }

  void Join() {
    if (result_.models.size() < 2) return;
    Begin("joins of models", 0.85);
    const int num_joins = JoinModels(
        options_, scene_, correspondences_.bearings, all_matches_, &result_);
    if (num_split_ > 0 || num_joins > 0) SortModels(&result_);
    End("joins of models",
        std::to_string(num_joins) + " of parts whose points tell their size, " +
            std::to_string(num_split_) +
            " parts taken out that no points tie or that the accelerometer "
            "puts elsewhere");
  }

  // 2.8
  void RefineAllMatches() {
    if (!options_.refinement.enabled) return;
    Begin("match refinement", 0.9);
    RefineStageMatches(options_, scene_, raw_matches_,
                       correspondences_.bearings, &result_);
    End("match refinement", DescribeMatches(result_));
  }

  // 2.9
  void MeasureSizes() {
    // Metres that came from the accelerometer are measured again.
    if (!result_.bridges.empty()) {
      for (CoarseModel& model : result_.models) model.metric = false;
    }
    if (scene_.inertial_motions.empty() ||
        std::all_of(result_.models.begin(), result_.models.end(),
                    [](const CoarseModel& model) { return model.metric; })) {
      return;
    }
    Begin("metres from the accelerometer", 0.95);
    for (CoarseModel& model : result_.models) {
      const std::vector<InertialLength> lengths =
          MeasureSize(scene_, result_.bridges, &model);
      result_.inertial_lengths.insert(result_.inertial_lengths.end(),
                                      lengths.begin(), lengths.end());
    }
    End("metres from the accelerometer", DescribeSizes(result_));
  }

  const GlobalStageOptions options_;
  const StageProgress& progress_;
  const RawMatchSource raw_matches_;
  SceneData& scene_;
  Stopwatch watch_;
  GlobalCorrespondences correspondences_;
  InitialViewGraph initial_;
  // Kept where models may be split, joined or estimated again.
  std::map<ImagePair, std::vector<FeatureMatch>> all_matches_;
  int num_split_ = 0;
  GlobalStageResult result_;
};

}  // namespace

bool IsBetterAcrossGaps(const GlobalStageResult& in_parts,
                        const GlobalStageResult& across) {
  return NumImagesOfLargest(across) > NumImagesOfLargest(in_parts) &&
         NumKeptPairs(across) >= kMinKeptRatio * NumKeptPairs(in_parts);
}

bool GlobalStageOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmGlobal", error)
             .Positive("pose_prior_sigma", pose_prior_sigma)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .PositiveOrMinusOne("num_threads", num_threads)
             .AllHold() &&
         poses.IsValid(error) && structure.IsValid(error) &&
         refinement.IsValid(error);
}

StatusOr<GlobalStageResult> RunGlobalStage(const GlobalStageOptions& options,
                                           SceneData* scene,
                                           const StageProgress& progress,
                                           RawMatchSource raw_matches) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  if (!raw_matches) raw_matches = RawMatchesOfScene(*scene);
  return GlobalStage(SetSharedOptions(options, *scene), progress,
                     std::move(raw_matches), scene)
      .Run();
}

}  // namespace adasfm
