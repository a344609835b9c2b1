// SPDX-License-Identifier: BSD-3-Clause
#include "partition/places.h"

#include <algorithm>
#include <vector>

namespace adasfm {
namespace {

// Where a wide baseline shows points at half a radian, 2 % of it shows them at
// 0.6 deg, less than a point needs.
constexpr double kPlaceRatio = 0.02;
// Neither a tenth of false pairs decides this nor nine tenths at rest.
constexpr double kWideQuantile = 0.9;

double WideBaseline(const ImageGraph& graph,
                    const std::map<image_t, Eigen::Vector3d>& positions) {
  std::vector<double> lengths;
  for (const auto& [pair, weight] : graph.edges) {
    const auto position1 = positions.find(pair.image_id1);
    const auto position2 = positions.find(pair.image_id2);
    if (position1 == positions.end() || position2 == positions.end()) continue;
    lengths.push_back((position1->second - position2->second).norm());
  }
  if (lengths.empty()) return 0.0;
  const auto wide =
      lengths.begin() + static_cast<size_t>(kWideQuantile * lengths.size());
  std::nth_element(lengths.begin(), wide, lengths.end());
  return *wide;
}

}  // namespace

std::map<image_t, image_t> FindPlaces(
    const ImageGraph& graph,
    const std::map<image_t, Eigen::Vector3d>& positions) {
  const ImageAdjacency adjacency = BuildAdjacency(graph);
  const double radius = kPlaceRatio * WideBaseline(graph, positions);
  std::map<image_t, image_t> place_of_image;
  for (const image_t first : graph.images) {
    if (!place_of_image.emplace(first, first).second) continue;
    const auto center = positions.find(first);
    if (center == positions.end()) continue;
    std::vector<image_t> reached = {first};
    while (!reached.empty()) {
      const image_t image_id = reached.back();
      reached.pop_back();
      for (const auto& [neighbor, weight] : adjacency.at(image_id)) {
        const auto position = positions.find(neighbor);
        if (position != positions.end() &&
            (position->second - center->second).norm() < radius &&
            place_of_image.emplace(neighbor, first).second) {
          reached.push_back(neighbor);
        }
      }
    }
  }
  return place_of_image;
}

ImageGraph MergePlaces(const ImageGraph& graph,
                       const std::map<image_t, image_t>& place_of_image) {
  ImageGraph places;
  for (const auto& [image_id, place] : place_of_image) {
    places.images.insert(place);
  }
  for (const auto& [pair, weight] : graph.edges) {
    const image_t place1 = place_of_image.at(pair.image_id1);
    const image_t place2 = place_of_image.at(pair.image_id2);
    if (place1 != place2) places.edges[ImagePair(place1, place2)] += weight;
  }
  return places;
}

}  // namespace adasfm
