// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/clock_jump.h"

#include <cmath>

#include "sensors/io/format_figures.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

constexpr double kGapPeriods = 3.0;

// The first sample after the longest gap; 0 without one.
size_t FindLongestGap(const std::vector<ImuSample>& imu) {
  std::vector<timestamp_t> times_ns;
  for (const ImuSample& sample : imu) times_ns.push_back(sample.timestamp_ns);
  double longest_s = kGapPeriods * ComputeMedianPeriod(times_ns);
  size_t after = 0;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    const double gap_s = SecondsFromNs(times_ns[i] - times_ns[i - 1]);
    if (gap_s <= longest_s) continue;
    longest_s = gap_s;
    after = i;
  }
  return after;
}

}  // namespace

std::string FindClockJump(const std::vector<TimedRotation>& rotations,
                          const std::vector<ImuSample>& imu,
                          const SensorCalibration& calibration) {
  const size_t cut = FindLongestGap(imu);
  if (cut == 0) return "";
  const std::vector<ImuSample> parts[] = {{imu.begin(), imu.begin() + cut},
                                          {imu.begin() + cut, imu.end()}};
  double shifts_s[2];
  for (int i = 0; i < 2; ++i) {
    const VisionCheck check =
        CheckAgainstVision(rotations, parts[i], calibration);
    if (!check.is_conclusive ||
        check.shifted_correlation < kMinAgreeingCorrelation) {
      return "";
    }
    shifts_s[i] = check.time_shift_correction_s;
  }
  const double jump_s = shifts_s[1] - shifts_s[0];
  if (std::abs(jump_s) <= kMaxAcceptedShiftS) return "";
  return "the IMU's clock jumps at the gap before the time " +
         std::to_string(imu[cut].timestamp_ns) +
         FormatFigures(
             ": from there on it is %.3f s ahead of the images, and "
             "%.3f s before; take the difference off the later "
             "times, or cut the log there",
             shifts_s[1], shifts_s[0]);
}

}  // namespace adasfm
