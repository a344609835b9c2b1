// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/check_logs.h"

#include <algorithm>
#include <cmath>

#include "sensors/calibration_check/check_wheels.h"
#include "sensors/io/format_figures.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

constexpr double kMinImagePeriodS = 1e-3;
constexpr double kMaxScaleError = 0.2;
constexpr double kMaxScaleFactor = 2.0;

template <typename Sample>
bool Covers(const std::vector<Sample>& log, timestamp_t time_ns) {
  return !log.empty() && time_ns >= log.front().timestamp_ns &&
         time_ns <= log.back().timestamp_ns;
}

}  // namespace

Status CheckCoverage(const std::vector<timestamp_t>& times_ns,
                     const MotionLogs& logs,
                     std::vector<std::string>* warnings) {
  const double period_s = ComputeMedianPeriod(times_ns);
  if (times_ns.size() > 2 && period_s < kMinImagePeriodS) {
    return Status::Error(FormatFigures(
        "the images are %.3g s apart; their times look like microseconds: "
        "multiply them by 1000 (nanoseconds are expected)",
        period_s));
  }
  if (logs.wheel.empty() && logs.odometry.empty()) return Status::Ok();
  const bool is_wheel = !logs.wheel.empty();
  const size_t num_covered =
      std::count_if(times_ns.begin(), times_ns.end(), [&](timestamp_t time_ns) {
        return is_wheel ? Covers(logs.wheel, time_ns)
                        : Covers(logs.odometry, time_ns);
      });
  if (2 * num_covered >= times_ns.size()) return Status::Ok();
  const timestamp_t first = is_wheel ? logs.wheel.front().timestamp_ns
                                     : logs.odometry.front().timestamp_ns;
  const timestamp_t last = is_wheel ? logs.wheel.back().timestamp_ns
                                    : logs.odometry.back().timestamp_ns;
  const std::string text =
      "the wheel log covers " +
      (num_covered == 0 ? std::string("no image")
                        : std::to_string(num_covered) + " of " +
                              std::to_string(times_ns.size()) + " images") +
      FormatFigures(": it runs from %.3f to %.3f s, ", SecondsFromNs(first),
                    SecondsFromNs(last)) +
      FormatFigures(
          "the images on the IMU's clock from %.3f to %.3f s; check "
          "the wheels' clock and whether the log was cut",
          SecondsFromNs(times_ns.front()), SecondsFromNs(times_ns.back()));
  if (num_covered == 0) return Status::Error(text);
  warnings->push_back(text);
  return Status::Ok();
}

std::string FindContradiction(const MotionLogs& logs,
                              const SensorCalibration& calibration,
                              std::vector<std::string>* warnings) {
  if (logs.imu.empty() || logs.wheel.empty()) return "";
  const bool has_yaw = ObservesYaw(calibration.wheel_type);
  const WheelCheck check =
      CheckWheels(logs.imu, logs.wheel, has_yaw, calibration);
  warnings->insert(warnings->end(), check.warnings.begin(),
                   check.warnings.end());
  return check.contradiction;
}

std::string DescribeWheelScale(double scale, bool* is_error) {
  *is_error = !(scale > 1.0 / kMaxScaleFactor && scale < kMaxScaleFactor);
  if (std::abs(scale - 1.0) <= kMaxScaleError) return "";
  const bool is_kmh = scale > 0.2 && scale < 0.35;
  return FormatFigures(
             "the wheels' scale is %.4g: a metre of the wheel log is "
             "%.3g true metres; ",
             scale, scale) +
         (is_kmh ? "the log looks like km/h (divide by 3.6)"
                 : "check the speeds' unit, the wheels' radius, "
                   "metres_per_tick, the wheels' clock and whether the log "
                   "belongs to this drive");
}

}  // namespace adasfm
