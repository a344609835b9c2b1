// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/visual_links.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Fewer say too little of a bias to be worth their risk.
constexpr int kMinNumLinks = 20;
constexpr int kMinNumInliers = 20;
// Poorer geometries err alike by more than a gyroscope does (0.1 deg where
// their noise is 0.3).
constexpr double kMaxSigma = 0.0035;  // rad
// Two-view geometries are never more exact than this.
constexpr double kMinSigma = 3e-4;  // rad
constexpr double kSigmaFactor = 1.5;
// Five times what a keypoint errs by.
constexpr double kMinSeenMotionRad = 5e-3;
// Of the turn: a slightly turned T_cam_imu moves whole bends.
constexpr double kTurnShare = 0.05;

// Vision against the gyroscope over the links: the errors' sigma per axis.
double EstimateSigma(const std::vector<OdometryLink>& links,
                     const std::vector<size_t>& indices) {
  std::vector<Eigen::Vector3d> errors;
  for (const size_t k : indices) {
    errors.push_back(LogSo3(links[k].imu.delta_rotation.conjugate() *
                            links[k].visual_rotation));
  }
  Eigen::Vector3d rate;
  std::vector<double> values(indices.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < indices.size(); ++i) {
      values[i] = errors[i][axis] / links[indices[i]].dt_s;
    }
    rate[axis] = UpperMedian(&values);
  }
  for (size_t i = 0; i < indices.size(); ++i) {
    values[i] = (errors[i] - rate * links[indices[i]].dt_s).norm();
  }
  return UpperMedian(&values) / kMedianNorm3;
}

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

// cam2_from_cam1 turns against the body's motion.
Eigen::Quaterniond BodyRotation(const TimedRotation& rotation,
                                const Eigen::Quaterniond& cam_from_imu) {
  return cam_from_imu.conjugate() * rotation.cam2_from_cam1.conjugate() *
         cam_from_imu;
}

VisualLinks AddVisualRotations(const std::vector<TimedRotation>& rotations,
                               timestamp_t timeshift_ns,
                               const Eigen::Quaterniond& cam_from_imu,
                               const OdometryTimeline& timeline,
                               OdometryFusionProblem* problem) {
  std::vector<size_t> indices;
  for (const TimedRotation& rotation : rotations) {
    const std::optional<size_t> k =
        FindLinkOfRotation(rotation, timeshift_ns, timeline);
    if (!k) continue;
    OdometryLink& link = problem->links[*k];
    if (!link.has_imu || link.dt_s <= 0.0) continue;
    link.visual_rotation = BodyRotation(rotation, cam_from_imu);
    indices.push_back(*k);
  }
  if (indices.size() < kMinNumLinks) return VisualLinks();
  const double sigma = EstimateSigma(problem->links, indices);
  if (sigma > kMaxSigma) return VisualLinks();
  VisualLinks result;
  result.num_links = static_cast<int>(indices.size());
  result.sigma_rad = kSigmaFactor * std::max(kMinSigma, sigma);
  for (const size_t k : indices) {
    problem->links[k].has_vision = true;
    const double turn = LogSo3(problem->links[k].visual_rotation).norm();
    problem->links[k].visual_sigma_rad =
        std::hypot(result.sigma_rad, kTurnShare * turn);
  }
  return result;
}

}  // namespace adasfm
