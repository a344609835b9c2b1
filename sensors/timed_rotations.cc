// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/timed_rotations.h"

#include <algorithm>
#include <set>

namespace adasfm {
namespace {

constexpr int kMinNumInliers = 20;
// Five times the error of a keypoint.
constexpr double kMinSeenMotionRad = 5e-3;

}  // namespace

std::vector<TimedRotation> ComputeTimedRotations(
    const std::vector<VisualRotation>& rotations,
    const std::map<image_t, timestamp_t>& image_times_ns) {
  std::vector<TimedRotation> timed;
  for (const VisualRotation& rotation : rotations) {
    const auto first = image_times_ns.find(rotation.image_id1);
    const auto second = image_times_ns.find(rotation.image_id2);
    if (first == image_times_ns.end() || second == image_times_ns.end()) {
      continue;
    }
    TimedRotation entry{first->second, second->second, rotation.cam2_from_cam1,
                        static_cast<double>(rotation.num_inliers)};
    if (entry.start_ns > entry.end_ns) {
      std::swap(entry.start_ns, entry.end_ns);
      entry.cam2_from_cam1 = entry.cam2_from_cam1.conjugate();
    }
    timed.push_back(entry);
  }
  return timed;
}

std::vector<std::pair<timestamp_t, timestamp_t>> FindSeenMotion(
    const std::vector<VisualRotation>& rotations,
    const std::map<image_t, timestamp_t>& image_times_ns) {
  std::set<timestamp_t> times;
  for (const auto& [image_id, time_ns] : image_times_ns) times.insert(time_ns);
  std::vector<std::pair<timestamp_t, timestamp_t>> intervals;
  for (const VisualRotation& rotation : rotations) {
    const auto first = image_times_ns.find(rotation.image_id1);
    const auto second = image_times_ns.find(rotation.image_id2);
    if (first == image_times_ns.end() || second == image_times_ns.end() ||
        rotation.median_motion_rad < kMinSeenMotionRad) {
      continue;
    }
    const auto [start_ns, end_ns] = std::minmax(first->second, second->second);
    const auto next = times.upper_bound(start_ns);
    if (next != times.end() && *next == end_ns) {
      intervals.emplace_back(start_ns, end_ns);
    }
  }
  std::sort(intervals.begin(), intervals.end());
  return intervals;
}

std::optional<size_t> FindLinkOfRotation(const TimedRotation& rotation,
                                         timestamp_t timeshift_ns,
                                         const OdometryTimeline& timeline,
                                         size_t num_links) {
  if (rotation.weight < kMinNumInliers) return std::nullopt;
  const std::vector<timestamp_t>& times = timeline.times_ns;
  const timestamp_t start = rotation.start_ns + timeshift_ns;
  const auto it = std::lower_bound(times.begin(), times.end(), start);
  const size_t k = it - times.begin();
  if (k + num_links >= times.size() || times[k] != start ||
      times[k + num_links] != rotation.end_ns + timeshift_ns) {
    return std::nullopt;
  }
  return k;
}

// cam2_from_cam1 rotates opposite to the body.
Eigen::Quaterniond BodyRotation(const TimedRotation& rotation,
                                const Eigen::Quaterniond& cam_from_imu) {
  return cam_from_imu.conjugate() * rotation.cam2_from_cam1.conjugate() *
         cam_from_imu;
}

}  // namespace adasfm
