// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/select_coarse_points.h"

#include <algorithm>
#include <map>
#include <utility>

namespace adasfm {

std::vector<TriangulatedTrack> SelectCoarsePoints(
    const CoarseStructureOptions& options,
    std::vector<TriangulatedTrack> triangulated, double* min_angle_deg) {
  std::vector<size_t> order(triangulated.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return triangulated[a].angle_deg > triangulated[b].angle_deg;
  });
  std::map<image_t, int> num_points;
  std::vector<char> selected(triangulated.size(), false);
  *min_angle_deg = options.triangulation.min_triangulation_angle_deg;
  for (const size_t i : order) {
    const TriangulatedTrack& point = triangulated[i];
    selected[i] =
        point.angle_deg >= options.triangulation.min_triangulation_angle_deg ||
        std::any_of(point.track.begin(), point.track.end(),
                    [&](const TrackElement& element) {
                      return num_points[element.image_id] <
                             kMinNumPointsPerImage;
                    });
    if (!selected[i]) continue;
    *min_angle_deg = std::min(*min_angle_deg, point.angle_deg);
    for (const TrackElement& element : point.track) {
      ++num_points[element.image_id];
    }
  }
  std::vector<TriangulatedTrack> result;
  for (size_t i = 0; i < triangulated.size(); ++i) {
    if (selected[i]) result.push_back(std::move(triangulated[i]));
  }
  return result;
}

}  // namespace adasfm
