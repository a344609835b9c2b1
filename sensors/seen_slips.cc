// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/seen_slips.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/median.h"
#include "core/so3.h"
#include "sensors/visual_links.h"

namespace adasfm {
namespace {

constexpr size_t kMinNumSeenLinks = 20;
constexpr double kMaxSlipRatio = 0.2;
// The median of a normal variable's absolute value.
constexpr double kMedianAbs = 0.6745;

struct SeenLink {
  size_t index = 0;
  double turn_rad = 0.0;   // about the wheels' vertical
  double error_rad = 0.0;  // of the wheels
};

}  // namespace

int LeaveOutSeenSlips(const std::vector<TimedRotation>& rotations,
                      timestamp_t timeshift_ns,
                      const Eigen::Quaterniond& cam_from_imu,
                      const OdometryTimeline& timeline,
                      const OdometryFusionOptions& options,
                      OdometryFusionProblem* problem) {
  const Eigen::Vector3d up =
      problem->imu_from_wheel.rotation * Eigen::Vector3d::UnitZ();
  std::vector<SeenLink> seen;
  std::vector<double> errors;
  for (const TimedRotation& rotation : rotations) {
    const std::optional<size_t> k =
        FindLinkOfRotation(rotation, timeshift_ns, timeline);
    if (!k) continue;
    const OdometryLink& link = problem->links[*k];
    if (link.has_imu || !link.has_wheel || !link.has_wheel_yaw) continue;
    SeenLink entry;
    entry.index = *k;
    entry.turn_rad = up.dot(LogSo3(BodyRotation(rotation, cam_from_imu)));
    entry.error_rad = link.wheel.yaw_rad - entry.turn_rad;
    errors.push_back(std::abs(entry.error_rad));
    seen.push_back(entry);
  }
  if (seen.size() < kMinNumSeenLinks) return 0;
  const double usual_rad = UpperMedian(&errors) / kMedianAbs;
  std::vector<size_t> slips;
  for (const SeenLink& entry : seen) {
    const WheelMotion& wheel = problem->links[entry.index].wheel;
    const double variance =
        std::max(usual_rad * usual_rad, wheel.yaw_variance) +
        std::pow(options.wheel_track_sigma * entry.turn_rad, 2) +
        std::pow(options.wheel_curvature_sigma * wheel.distance_m, 2);
    if (std::abs(entry.error_rad) >
        options.slip_threshold_sigma * std::sqrt(variance)) {
      slips.push_back(entry.index);
    }
  }
  if (slips.size() > kMaxSlipRatio * seen.size()) return 0;
  for (const size_t k : slips) {
    problem->links[k].has_wheel = false;
    problem->links[k].has_wheel_yaw = false;
  }
  return static_cast<int>(slips.size());
}

}  // namespace adasfm
