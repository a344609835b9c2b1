// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/refine_stage_matches.h"

#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/scene_bearings.h"

namespace adasfm {
namespace {

// Pairs whose matches show another place than the poses say. Refinement cannot
// tell: two look-alike places on one straight street differ only by a motion
// along the line of sight, which leaves their matches on the epipolar lines.
std::set<ImagePair> FindRefutedPairs(const ViewGraph& graph) {
  std::set<ImagePair> refuted;
  for (const ViewGraphEdge& edge : graph.edges) {
    switch (edge.removal) {
      case EdgeRemoval::kOdometry:
      case EdgeRemoval::kFalseLoop:
      case EdgeRemoval::kUnverifiedJoin:
      case EdgeRemoval::kRotation:
      case EdgeRemoval::kTranslation:
        refuted.insert(edge.Pair());
        break;
      case EdgeRemoval::kKept:
      case EdgeRemoval::kFewInliers:
      case EdgeRemoval::kRelativePose:
      case EdgeRemoval::kOdometryPose:
      case EdgeRemoval::kUnknownSize:
      case EdgeRemoval::kDisconnected:
        break;
    }
  }
  return refuted;
}

// By model: the pairs within it and the matches to choose from. Refuted pairs
// and those between models go to the removed ones.
using Candidates = std::vector<std::map<ImagePair, std::vector<FeatureMatch>>>;
Candidates SortCandidates(const SceneData& scene, GlobalStageResult* result) {
  std::map<image_t, int> component_of;
  for (size_t i = 0; i < result->models.size(); ++i) {
    for (const image_t id : result->models[i].reconstruction.RegImageIds()) {
      component_of[id] = static_cast<int>(i);
    }
  }
  Candidates candidates(result->models.size());
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
  return candidates;
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

void RefineStageMatches(const GlobalStageOptions& options,
                        const SceneData& scene,
                        const std::map<image_t, std::vector<Bearing>>& bearings,
                        GlobalStageResult* result) {
  const Candidates candidates = SortCandidates(scene, result);
  for (size_t i = 0; i < result->models.size(); ++i) {
    const colmap::Reconstruction& model = result->models[i].reconstruction;
    std::map<image_t, std::vector<Bearing>> refined;
    if (result->models[i].cameras_refined) {
      refined = ComputeModelBearings(model, options.num_threads);
    }
    const MatchRefinementReport report =
        RefineMatches(options.refinement, CamsFromWorld(model),
                      refined.empty() ? bearings : refined, candidates[i]);
    MatchRefinementReport& total = result->refinement;
    total.pairs.insert(total.pairs.end(), report.pairs.begin(),
                       report.pairs.end());
    total.num_removed_pairs += report.num_removed_pairs;
    total.num_candidates += report.num_candidates;
    total.num_kept += report.num_kept;
  }
  CollectGeometries(result);
}

}  // namespace adasfm
