// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/refine_stage_matches.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/scene_bearings.h"

namespace adasfm {
namespace {

// The noise of both keypoints moves either one off its line by sqrt(2) sigma.
// The distances of a true match in both views sum to at most twice three of
// these.
constexpr double kMaxErrorPerSigma = 2.0 * 3.0 * 1.4142;

// eps_M, or the limit by the keypoints' noise where that is more: photos of
// large sensors have keypoints that err by two pixels, and half of their true
// matches lie beyond 4 px.
MatchRefinementOptions FitToNoise(MatchRefinementOptions options,
                                  const colmap::Reconstruction& model) {
  const std::optional<double> sigma_px =
      EstimateKeypointSigmas(model).of_all_px;
  if (sigma_px) {
    options.max_epipolar_error_px =
        std::max(options.max_epipolar_error_px, kMaxErrorPerSigma * *sigma_px);
  }
  return options;
}

// Pairs whose matches contradict the poses. Refinement cannot detect them: two
// aliased places on one straight street differ only by a motion along the line
// of sight, which leaves their matches on the epipolar lines.
std::set<ImagePair> FindRejectedPairs(const ViewGraph& graph) {
  std::set<ImagePair> rejected;
  for (const ViewGraphEdge& edge : graph.edges) {
    switch (edge.removal) {
      case EdgeRemoval::kOdometry:
      case EdgeRemoval::kFalseLoop:
      case EdgeRemoval::kUnconfirmedClosure:
      case EdgeRemoval::kRotation:
      case EdgeRemoval::kTranslation:
        rejected.insert(edge.Pair());
        break;
      case EdgeRemoval::kKept:
      case EdgeRemoval::kFewInliers:
      case EdgeRemoval::kOdometryPose:
      case EdgeRemoval::kUnknownSize:
      case EdgeRemoval::kDisconnected:
        break;
    }
  }
  return rejected;
}

// The pairs within each model. Rejected pairs and those between models are
// added to the removed ones.
std::vector<std::vector<const ScenePair*>> SortPairs(
    const SceneData& scene, GlobalStageResult* result) {
  std::map<image_t, int> component_of;
  for (size_t i = 0; i < result->models.size(); ++i) {
    for (const image_t id : result->models[i].reconstruction.RegImageIds()) {
      component_of[id] = static_cast<int>(i);
    }
  }
  std::vector<std::vector<const ScenePair*>> pairs(result->models.size());
  const std::set<ImagePair> rejected = FindRejectedPairs(result->poses.graph);
  for (const ScenePair& pair : scene.pairs) {
    const auto it1 = component_of.find(pair.image_id1);
    const auto it2 = component_of.find(pair.image_id2);
    if (it1 == component_of.end() || it2 == component_of.end()) {
      ++result->refinement.num_skipped_pairs;
    } else if (rejected.count(ImagePair(pair.image_id1, pair.image_id2))) {
      result->removed_pairs.emplace_back(pair.image_id1, pair.image_id2);
    } else if (it1->second == it2->second) {
      pairs[it1->second].push_back(&pair);
    } else {
      // The view graph found no consistent way to join the two components.
      result->removed_pairs.emplace_back(pair.image_id1, pair.image_id2);
    }
  }
  return pairs;
}

void Append(MatchRefinementReport* report, MatchRefinementReport* total) {
  std::move(report->pairs.begin(), report->pairs.end(),
            std::back_inserter(total->pairs));
  total->num_removed_pairs += report->num_removed_pairs;
  total->num_skipped_pairs += report->num_skipped_pairs;
  total->num_candidates += report->num_candidates;
  total->num_kept += report->num_kept;
}

// The refined pairs as new rows and removals.
void CollectGeometries(GlobalStageResult* result) {
  for (RefinedPair& pair : result->refinement.pairs) {
    if (pair.removed) {
      result->removed_pairs.push_back(pair.pair);
    } else if (!pair.cam2_from_cam1.translation.isZero()) {
      // Cameras at one place, as of equal photos, have no epipolar geometry.
      result->geometries.push_back(
          {pair.pair, std::move(pair.matches), pair.cam2_from_cam1});
    }
  }
  result->refinement.pairs.clear();
  std::sort(result->removed_pairs.begin(), result->removed_pairs.end());
  std::sort(result->geometries.begin(), result->geometries.end(),
            [](const auto& a, const auto& b) { return a.pair < b.pair; });
}

}  // namespace

void RefineRawMatches(const MatchRefinementOptions& options,
                      const RawMatchSource& source,
                      const std::map<image_t, Rigid3d>& cams_from_world,
                      const std::map<image_t, std::vector<Bearing>>& bearings,
                      const std::vector<const ScenePair*>& pairs,
                      MatchRefinementReport* total) {
  for (size_t begin = 0; begin < pairs.size(); begin += kNumPairsAtATime) {
    const size_t end = std::min(pairs.size(), begin + kNumPairsAtATime);
    std::vector<ImagePair> block;
    for (size_t k = begin; k < end; ++k) {
      block.emplace_back(pairs[k]->image_id1, pairs[k]->image_id2);
    }
    RawMatches candidates = source(block);
    for (size_t k = begin; k < end; ++k) {
      candidates.emplace(block[k - begin], pairs[k]->inlier_matches);
    }
    MatchRefinementReport report =
        RefineMatches(options, cams_from_world, bearings, candidates);
    Append(&report, total);
  }
}

PairAgreement MeasureModelAgreement(
    const GlobalStageOptions& options, const SceneData& scene,
    const ViewGraph& graph,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const CoarseModel& model) {
  return MeasurePairAgreement(
      FitToNoise(options.refinement, model.reconstruction), scene, graph,
      CamsFromWorld(model.reconstruction),
      model.cameras_refined
          ? ComputeModelBearings(model.reconstruction, options.num_threads)
          : bearings);
}

void MeasurePairAgreements(
    const GlobalStageOptions& options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    GlobalStageResult* result) {
  for (CoarseModel& model : result->models) {
    model.pair_agreement = MeasureModelAgreement(
        options, scene, result->poses.graph, bearings, model);
  }
}

void RefineStageMatches(const GlobalStageOptions& options,
                        const SceneData& scene, const RawMatchSource& source,
                        const std::map<image_t, std::vector<Bearing>>& bearings,
                        GlobalStageResult* result) {
  const std::vector<std::vector<const ScenePair*>> pairs =
      SortPairs(scene, result);
  for (size_t i = 0; i < result->models.size(); ++i) {
    const colmap::Reconstruction& model = result->models[i].reconstruction;
    MatchRefinementReport report;
    std::map<image_t, std::vector<Bearing>> refined;
    if (result->models[i].cameras_refined) {
      refined = ComputeModelBearings(model, options.num_threads);
    }
    RefineRawMatches(FitToNoise(options.refinement, model), source,
                     CamsFromWorld(model), refined.empty() ? bearings : refined,
                     pairs[i], &report);
    result->models[i].mapper_start = FindMapperStart(report.pairs);
    Append(&report, &result->refinement);
  }
  CollectGeometries(result);
}

}  // namespace adasfm
