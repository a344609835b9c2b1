// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/pair_agreement.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"

namespace adasfm {
namespace {

bool Counts(const ViewGraph& graph, const ScenePair& pair) {
  const int e = FindEdge(graph, ImagePair(pair.image_id1, pair.image_id2));
  if (e < 0) return false;
  const ViewGraphEdge& edge = graph.edges[e];
  const bool is_in_question = edge.IsKept() ||
                              edge.removal == EdgeRemoval::kRotation ||
                              edge.removal == EdgeRemoval::kTranslation;
  // Without a baseline there are no epipolar lines to fit.
  return is_in_question && edge.has_baseline && edge.has_translation &&
         edge.source != EdgeSource::kSensor;
}

}  // namespace

PairAgreement MeasurePairAgreement(
    const MatchRefinementOptions& options, const SceneData& scene,
    const ViewGraph& graph, const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings) {
  // Shares of images with fewer pairs are not reliable.
  constexpr int kMinNumPairs = 5;
  std::vector<const ScenePair*> pairs;
  for (const ScenePair& pair : scene.pairs) {
    if (cams_from_world.count(pair.image_id1) > 0 &&
        cams_from_world.count(pair.image_id2) > 0 && Counts(graph, pair)) {
      pairs.push_back(&pair);
    }
  }
  std::vector<char> fits(pairs.size());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t k) {
    const ScenePair& pair = *pairs[k];
    const int num_fitting = CountFittingMatches(
        options.max_epipolar_error_px,
        ComputeCam2FromCam1(cams_from_world.at(pair.image_id1),
                            cams_from_world.at(pair.image_id2)),
        bearings.at(pair.image_id1), bearings.at(pair.image_id2),
        pair.inlier_matches);
    fits[k] =
        2 * static_cast<size_t>(num_fitting) >= pair.inlier_matches.size();
  });

  PairAgreement agreement;
  if (pairs.empty()) return agreement;
  std::map<image_t, std::pair<int, int>> by_image;
  for (size_t k = 0; k < pairs.size(); ++k) {
    for (const image_t image_id : {pairs[k]->image_id1, pairs[k]->image_id2}) {
      ++by_image[image_id].first;
      by_image[image_id].second += fits[k];
    }
  }
  agreement.share =
      static_cast<double>(std::count(fits.begin(), fits.end(), 1)) /
      static_cast<double>(pairs.size());
  for (const auto& [image_id, counts] : by_image) {
    if (counts.first < kMinNumPairs) continue;
    agreement.least_image_share =
        std::min(agreement.least_image_share,
                 static_cast<double>(counts.second) / counts.first);
  }
  return agreement;
}

}  // namespace adasfm
