// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/weak_places.h"

#include <algorithm>
#include <map>
#include <utility>

namespace adasfm {

std::vector<WeakPlace> FindWeakPlaces(const CoarsePoses& poses) {
  std::map<image_t, int> model_of_image;
  for (size_t k = 0; k < poses.components.size(); ++k) {
    for (const auto& [image_id, pose] : poses.components[k].cams_from_world) {
      model_of_image[image_id] = static_cast<int>(k);
    }
  }
  std::map<std::pair<int, int>, WeakPlace> places;
  for (const ViewGraphEdge& edge : poses.graph.edges) {
    const auto model1 = model_of_image.find(edge.image_id1);
    const auto model2 = model_of_image.find(edge.image_id2);
    if (edge.source == EdgeSource::kSensor || edge.IsKept() ||
        model1 == model_of_image.end() || model2 == model_of_image.end() ||
        model1->second == model2->second) {
      continue;
    }
    const auto models = std::minmax(model1->second, model2->second);
    WeakPlace& place = places[{models.first, models.second}];
    ++place.num_pairs;
    if (place.num_pairs > 1 && edge.num_inliers <= place.num_inliers) continue;
    place.model1 = models.first;
    place.model2 = models.second;
    place.pair = edge.Pair();
    place.num_inliers = edge.num_inliers;
    place.removal = edge.removal;
  }
  std::vector<WeakPlace> list;
  for (const auto& [models, place] : places) list.push_back(place);
  return list;
}

}  // namespace adasfm
