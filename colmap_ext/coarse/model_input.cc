// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/model_input.h"

#include <utility>
#include <vector>

#include "core/median.h"
#include "global/translation_averaging/translation_averaging.h"

namespace adasfm {
namespace {

std::vector<PosePriorEdge> FindRestPairs(
    const ViewGraph& graph, const std::map<image_t, Rigid3d>& cams_from_world) {
  std::vector<PosePriorEdge> rest_pairs;
  std::vector<double> lengths;
  for (const ViewGraphEdge& edge : graph.edges) {
    const auto image1 = cams_from_world.find(edge.image_id1);
    const auto image2 = cams_from_world.find(edge.image_id2);
    if (!edge.IsKept() || !edge.has_translation ||
        image1 == cams_from_world.end() || image2 == cams_from_world.end()) {
      continue;
    }
    if (!edge.IsJoinAtRest()) {
      lengths.push_back((image1->second.TargetOriginInSource() -
                         image2->second.TargetOriginInSource())
                            .norm());
      continue;
    }
    PosePriorEdge pair;
    pair.image_id1 = edge.image_id1;
    pair.image_id2 = edge.image_id2;
    pair.cam2_from_cam1 = edge.cam2_from_cam1;
    rest_pairs.push_back(pair);
  }
  if (lengths.empty()) return {};
  const double sigma = kRestSigmaRatio * UpperMedian(&lengths);
  for (PosePriorEdge& pair : rest_pairs) pair.translation_sigma_m = sigma;
  return rest_pairs;
}

}  // namespace

CoarseModelInput CreateModelInput(const GlobalStageOptions& options,
                                  const GlobalStageResult& result,
                                  std::map<image_t, Rigid3d> cams_from_world) {
  CoarseModelInput input;
  input.priors = result.poses.priors;
  input.cams_from_world = std::move(cams_from_world);
  input.rest_pairs = FindRestPairs(result.poses.graph, input.cams_from_world);
  input.refine_lenses = options.structure.refine_unknown_focal_length &&
                        !result.focal_lengths.empty();
  return input;
}

}  // namespace adasfm
