// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/select_photos.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Photos whose directions differ more share too little.
constexpr double kMaxTurnRad = DegToRad(10.0);
// Speeds are not extrapolated over longer gaps of the log.
constexpr double kMaxStepS = 1.0;

// Distance and angle that the machine has travelled up to a time.
struct Way {
  timestamp_t timestamp_ns = 0;
  double distance_m = 0.0;
  double turn_rad = 0.0;
};

std::vector<Way> WayOfPoses(const std::vector<OdometryPose>& poses) {
  std::vector<Way> ways;
  Way way;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (i > 0) {
      const Rigid3d step =
          poses[i - 1].world_from_body.Inverse() * poses[i].world_from_body;
      way.distance_m += step.translation.norm();
      way.turn_rad += LogSo3(step.rotation).norm();
    }
    way.timestamp_ns = poses[i].timestamp_ns;
    ways.push_back(way);
  }
  return ways;
}

struct Speed {
  double forward = 0.0;   // m/s
  double yaw_rate = 0.0;  // rad/s
};

// Without a calibration the track width and the wheelbase are those of a small
// machine: a larger one turns less than computed, and more photos are taken.
Speed SpeedOf(WheelType type, const WheelSample& sample) {
  constexpr double kTrackWidthM = 0.3;
  constexpr double kWheelbaseM = 0.5;
  switch (type) {
    case WheelType::kDifferential:
      return {0.5 * (sample.first + sample.second),
              (sample.second - sample.first) / kTrackWidthM};
    case WheelType::kSteering:
      return {sample.first,
              sample.first * std::tan(sample.second) / kWheelbaseM};
    case WheelType::kSpeed:
      return {sample.first, 0.0};
    default:
      return {sample.first, sample.second};
  }
}

std::vector<Way> WayOfSpeeds(WheelType type,
                             const std::vector<WheelSample>& samples) {
  std::vector<Way> ways;
  Way way;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (i > 0) {
      const double step_s = std::min(
          kMaxStepS,
          SecondsFromNs(samples[i].timestamp_ns - samples[i - 1].timestamp_ns));
      const Speed speed = SpeedOf(type, samples[i]);
      way.distance_m += std::abs(speed.forward) * step_s;
      way.turn_rad += std::abs(speed.yaw_rate) * step_s;
    }
    way.timestamp_ns = samples[i].timestamp_ns;
    ways.push_back(way);
  }
  return ways;
}

// Empty when the log has no lengths in metres.
std::vector<Way> FindWay(const BagLogs& logs) {
  if (!logs.odometry.empty()) return WayOfPoses(logs.odometry);
  if (CountsTicks(logs.wheel_type)) return {};
  return WayOfSpeeds(logs.wheel_type, logs.wheel);
}

// The last entry at or before a time; the first entry for earlier times.
const Way& WayAt(const std::vector<Way>& ways, timestamp_t time_ns) {
  const auto after = std::upper_bound(
      ways.begin(), ways.end(), time_ns,
      [](timestamp_t time, const Way& way) { return time < way.timestamp_ns; });
  return after == ways.begin() ? ways.front() : *(after - 1);
}

}  // namespace

bool PhotoSelectionOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .AtLeast(1, "image_step", image_step)
      .NotNegative({{"image_distance_m", image_distance_m}})
      .AllHold();
}

StatusOr<std::set<timestamp_t>> SelectPhotos(
    const BagLogs& logs, const PhotoSelectionOptions& options) {
  std::set<timestamp_t> selected;
  const std::vector<Way> ways = FindWay(logs);
  if (options.image_distance_m > 0.0 && ways.empty()) {
    return Status::Error(
        "--image_distance_m needs a wheel log in metres: in a bag a topic of "
        "odometry or twists, with a video --wheel_path; use --image_step");
  }
  const Way* last = nullptr;
  for (size_t i = 0; i < logs.image_times_ns.size(); i += options.image_step) {
    const timestamp_t time_ns = logs.image_times_ns[i];
    if (options.image_distance_m > 0.0) {
      const Way& way = WayAt(ways, time_ns);
      const bool is_near =
          last != nullptr &&
          way.distance_m - last->distance_m < options.image_distance_m &&
          way.turn_rad - last->turn_rad < kMaxTurnRad;
      if (is_near) continue;
      last = &way;
    }
    selected.insert(time_ns);
  }
  return selected;
}

}  // namespace adasfm
