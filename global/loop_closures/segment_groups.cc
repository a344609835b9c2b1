// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/segment_groups.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "core/so3.h"

namespace adasfm {

SegmentGroups::SegmentGroups(const TrajectorySegments& segments,
                             const OdometryChain& chain, const ViewGraph& graph)
    : segments_(segments),
      chain_(chain),
      graph_(graph),
      groups_(graph.images.size()),
      is_metric_(segments.is_metric),
      num_images_(segments.num_images) {}

int SegmentGroups::GroupOf(int image) const {
  return groups_.Find(segments_.segment_of[image]);
}

void SegmentGroups::Join(const Closure& closure) {
  const int a = GroupOf(closure.i);
  const int b = GroupOf(closure.j);
  // The smaller index stands for both.
  groups_.Join(std::max(a, b), std::min(a, b));
  is_metric_[std::min(a, b)] = is_metric_[a] && is_metric_[b];
  num_images_[std::min(a, b)] = num_images_[a] + num_images_[b];
  closures_[segments_.segment_of[closure.i]].push_back(closure);
  closures_[segments_.segment_of[closure.j]].push_back(closure.Inverse());
}

std::optional<SegmentGroups::Motion> SegmentGroups::MotionInSegment(
    int i, int j) const {
  const image_t image_id1 = graph_.images[i];
  const image_t image_id2 = graph_.images[j];
  if (!chain_.IsConnected(image_id1, image_id2)) return std::nullopt;
  const ChainMotion motion = chain_.Motion(image_id1, image_id2);
  if (!motion.has_rotation) return std::nullopt;
  return Motion{{motion.cam2_from_cam1, motion.covariance},
                motion.has_position};
}

std::optional<SegmentGroups::Motion> SegmentGroups::FindMotion(int i,
                                                               int j) const {
  // Depth first through the tree: places reached, with the motion from i.
  struct Place {
    int image;
    int previous_segment;
    Motion motion;  // image_from_i
  };
  std::vector<Place> places = {{i, -1, {UncertainMotion(), true}}};
  while (!places.empty()) {
    const Place place = places.back();
    places.pop_back();
    const auto reach = [&](int image) -> std::optional<Motion> {
      const std::optional<Motion> step = MotionInSegment(place.image, image);
      if (!step) return std::nullopt;
      return Motion{step->j_from_i * place.motion.j_from_i,
                    step->has_position && place.motion.has_position};
    };
    const int segment = segments_.segment_of[place.image];
    if (segment == segments_.segment_of[j]) return reach(j);
    const auto closures = closures_.find(segment);
    if (closures == closures_.end()) continue;
    for (const Closure& closure : closures->second) {
      const int next = segments_.segment_of[closure.j];
      if (next == place.previous_segment) continue;
      std::optional<Motion> motion = reach(closure.i);
      if (!motion) continue;
      motion->j_from_i = closure.j_from_i.motion * motion->j_from_i;
      motion->has_position &=
          closure.j_from_i.translation == PairMotion::Translation::kFull;
      places.push_back({closure.j, segment, *motion});
    }
  }
  return std::nullopt;
}

bool SegmentGroups::AreApart(int i, int j, int max_sequence_gap) const {
  if (segments_.segment_of[i] == segments_.segment_of[j]) {
    return std::abs(segments_.rank_of[i] - segments_.rank_of[j]) >
               max_sequence_gap &&
           segments_.heading_of[i] != segments_.heading_of[j];
  }
  const std::optional<Motion> motion = FindMotion(i, j);
  return motion && AngleBetweenRad(motion->j_from_i.cam2_from_cam1.rotation,
                                   Eigen::Quaterniond::Identity()) >
                       DegToRad(kMinTurnDeg);
}

}  // namespace adasfm
