// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/log_checks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/median.h"
#include "sensors/io/format_figures.h"

namespace adasfm {
namespace {

constexpr double kGravity = 9.81;
constexpr double kGapPeriods = 3.0;
// The median of |a| of a driving machine stays near gravity; a larger median
// means a wrong unit.
constexpr double kMaxMeanForceInG = 4.0;
constexpr double kRestTolerance = 0.05;
// An rms above this (290 deg/s over the whole log) means a log in degrees:
// gyroscopes of machines saturate near 2000 deg/s = 35 rad/s.
constexpr double kMaxRateRms = 5.0;

// Samples in windows of about one second.
constexpr double kWindowS = 1.0;

struct Window {
  size_t begin = 0;
  size_t size = 0;
  Eigen::Vector3d mean_rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();
  double rate_sigma = 0.0;
  double force_sigma = 0.0;
};

std::vector<Window> ComputeWindows(const std::vector<ImuSample>& samples) {
  std::vector<Window> windows;
  size_t begin = 0;
  for (size_t end = 1; end <= samples.size(); ++end) {
    const bool is_full = SecondsFromNs(samples[end - 1].timestamp_ns -
                                       samples[begin].timestamp_ns) >= kWindowS;
    if (!is_full) continue;
    Window window;
    window.begin = begin;
    window.size = end - begin;
    for (size_t i = begin; i < end; ++i) {
      window.mean_rate += samples[i].angular_velocity / window.size;
      window.mean_force += samples[i].specific_force / window.size;
    }
    double rate_sum = 0.0, force_sum = 0.0;
    for (size_t i = begin; i < end; ++i) {
      rate_sum +=
          (samples[i].angular_velocity - window.mean_rate).squaredNorm();
      force_sum +=
          (samples[i].specific_force - window.mean_force).squaredNorm();
    }
    window.rate_sigma = std::sqrt(rate_sum / window.size);
    window.force_sigma = std::sqrt(force_sum / window.size);
    windows.push_back(window);
    begin = end;
  }
  return windows;
}

// The rms rate of all but the fastest twentieth of the samples, so that a few
// bad samples do not look like a wrong unit. fastest: the index of the fastest
// sample.
double ComputeRateRms(const std::vector<ImuSample>& samples, size_t* fastest) {
  std::vector<double> squares;
  for (const ImuSample& sample : samples) {
    squares.push_back(sample.angular_velocity.squaredNorm());
  }
  *fastest = std::max_element(squares.begin(), squares.end()) - squares.begin();
  std::sort(squares.begin(), squares.end());
  const size_t count = squares.size() - squares.size() / 20;
  return std::sqrt(
      std::accumulate(squares.begin(), squares.begin() + count, 0.0) / count);
}

Status CheckForceUnits(const std::vector<ImuSample>& samples,
                       const LogOrigin& origin) {
  std::vector<double> norms;
  for (const ImuSample& sample : samples) {
    norms.push_back(sample.specific_force.norm());
  }
  const double median = UpperMedian(&norms);
  if (median > 0.5 && median < 2.0) {
    return Status::Error(
        origin.Locate(0) +
        FormatFigures(": |a| is %.2f over the log: accelerations look like g; "
                      "multiply columns 5 to 7 by 9.81 (m/s^2 are expected)",
                      median));
  }
  if (median < 0.5 * kGravity || median > kMaxMeanForceInG * kGravity) {
    return Status::Error(
        origin.Locate(0) +
        FormatFigures(
            ": |a| is %.3g over the log where about 9.81 m/s^2 is "
            "expected; accelerations must contain gravity and be in m/s^2",
            median));
  }
  return Status::Ok();
}

}  // namespace

double ComputeMedianPeriod(const std::vector<timestamp_t>& times_ns) {
  if (times_ns.size() < 2) return 0.0;
  std::vector<double> periods;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    periods.push_back(SecondsFromNs(times_ns[i] - times_ns[i - 1]));
  }
  return UpperMedian(&periods);
}

Status CheckLogTimes(const std::vector<timestamp_t>& times_ns,
                     const LogOrigin& origin,
                     std::vector<std::string>* warnings) {
  for (size_t i = 1; i < times_ns.size(); ++i) {
    if (times_ns[i] > times_ns[i - 1]) continue;
    if (times_ns[i] == times_ns[i - 1]) {
      return Status::Error(origin.Locate(i) +
                           ": repeats the time of the line before it; remove "
                           "duplicates from the log");
    }
    return Status::Error(
        origin.Locate(i) +
        FormatFigures(
            ": time goes back by %.6f s; the log is not in order of time, "
            "joins two recordings or mixes two sensors: sort it, cut it or "
            "keep one",
            SecondsFromNs(times_ns[i - 1] - times_ns[i])));
  }
  const double period = ComputeMedianPeriod(times_ns);
  size_t num_gaps = 0, first = 0, longest = 0;
  double longest_s = 0.0;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    const double gap = SecondsFromNs(times_ns[i] - times_ns[i - 1]);
    if (gap <= kGapPeriods * period) continue;
    if (num_gaps++ == 0) first = i;
    if (gap > longest_s) {
      longest_s = gap;
      longest = i;
    }
  }
  if (num_gaps > 0 && warnings != nullptr) {
    warnings->push_back(
        origin.Locate(first) + ": first of " + std::to_string(num_gaps) +
        FormatFigures(" gaps of more than 3 periods; the longest lasts %.3f s",
                      longest_s) +
        " before " + origin.unit + " " +
        std::to_string(origin.line_numbers[longest]) +
        "; samples were lost in the recording");
  }
  return Status::Ok();
}

Status CheckImuUnits(const std::vector<ImuSample>& samples,
                     const LogOrigin& origin) {
  if (samples.empty()) return Status::Ok();
  Status status = CheckForceUnits(samples, origin);
  if (!status.ok()) return status;

  size_t largest = 0;
  const double rate_rms = ComputeRateRms(samples, &largest);
  if (rate_rms > kMaxRateRms) {
    return Status::Error(
        origin.Locate(largest) +
        FormatFigures(
            ": angular velocity is %.1f here and %.1f rms over the log: it "
            "looks like deg/s; multiply columns 2 to 4 by pi / 180 (rad/s "
            "are expected)",
            samples[largest].angular_velocity.norm(), rate_rms));
  }
  // At rest: windows with far less motion than any driving shows.
  for (const Window& window : ComputeWindows(samples)) {
    if (window.rate_sigma > 0.01 || window.force_sigma > 0.1) continue;
    // Cruising steadily round a bend is not rest.
    if (window.mean_rate.norm() > 0.05) continue;
    const double norm = window.mean_force.norm();
    if (std::abs(norm - kGravity) > kRestTolerance * kGravity) {
      return Status::Error(
          origin.Locate(window.begin) +
          FormatFigures(
              ": |a| at rest is %.3f m/s^2, %.1f %% off 9.81; the "
              "accelerometer's scale or units are wrong: calibrate it",
              norm, 100.0 * std::abs(norm / kGravity - 1.0)));
    }
  }
  return Status::Ok();
}

}  // namespace adasfm
