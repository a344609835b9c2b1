// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/sensor_summary.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"
#include "sensors/io/log_checks.h"

namespace adasfm {
namespace {

template <typename Sample>
void MeasureRate(const std::vector<Sample>& samples, double* rate_hz,
                 int* num_gaps, double* max_gap_s) {
  std::vector<timestamp_t> times;
  times.reserve(samples.size());
  for (const Sample& sample : samples) times.push_back(sample.timestamp_ns);
  const double period = ComputeMedianPeriod(times);
  if (period <= 0.0) return;
  *rate_hz = 1.0 / period;
  for (size_t i = 1; i < times.size(); ++i) {
    const double gap = SecondsFromNs(times[i] - times[i - 1]);
    if (gap <= 3.0 * period) continue;
    ++*num_gaps;
    *max_gap_s = std::max(*max_gap_s, gap);
  }
}

}  // namespace

void SummarizeRates(const MotionLogs& logs, SensorSummary* summary) {
  MeasureRate(logs.imu, &summary->imu_rate_hz, &summary->num_imu_gaps,
              &summary->max_imu_gap_s);
  if (logs.odometry.empty()) {
    MeasureRate(logs.wheel, &summary->wheel_rate_hz, &summary->num_wheel_gaps,
                &summary->max_wheel_gap_s);
  } else {
    MeasureRate(logs.odometry, &summary->wheel_rate_hz,
                &summary->num_wheel_gaps, &summary->max_wheel_gap_s);
  }
}

void SummarizeFusion(const OdometryFusionProblem& problem,
                     const OdometryFusionResult& fused, const MotionLogs& logs,
                     SensorSummary* summary) {
  for (const OdometryLink& link : problem.links) {
    if (link.standstill != StandstillKind::kNone)
      summary->standstill_s += link.dt_s;
  }
  for (size_t k = 0; k < problem.links.size(); ++k) {
    if (!problem.links[k].has_wheel) continue;
    summary->distance_m += fused.motions[k].body2_from_body1.translation.norm();
  }
  summary->gyroscope_bias_covariance = fused.gyroscope_bias_covariance;
  if (!logs.imu.empty()) {
    summary->gyroscope_bias = fused.gyroscope_bias;
    for (const OdometryState& state : fused.states) {
      summary->accelerometer_bias +=
          state.bias.accelerometer / fused.states.size();
    }
    summary->gyroscope_bias_sigma = fused.gyroscope_bias_sigma;
    summary->accelerometer_bias_sigma = fused.accelerometer_bias_sigma;
  }
  if (!(logs.wheel.empty() && logs.odometry.empty())) {
    summary->wheel_scale = fused.wheel_scale;
    summary->wheel_scale_sigma = fused.wheel_scale_sigma;
    summary->wheel_persistence = problem.wheel_persistence;
    // Where the wheels' errors do not persist, lengths err independently.
    if (problem.wheel_persistence > 1.0) {
      summary->length_drift_ratio = fused.speed_sigma_ratio;
    }
    summary->wheel_delay_s = fused.wheel_delay_s;
    summary->wheel_delay_sigma_s = fused.wheel_delay_sigma_s;
    summary->driving_direction_deg = RadToDeg(1.0) * fused.driving_direction;
    summary->driving_direction_sigma_deg =
        RadToDeg(1.0) * fused.driving_direction_sigma;
  }
  if (!fused.converged) {
    summary->warnings.push_back(
        "the odometry smoother did not converge: IMU and wheels seem to "
        "contradict each other; check T_imu_wheel and the noise figures");
  }
}

std::vector<WheelSlip> ListWheelSlips(const OdometryFusionResult& fused,
                                      const OdometryTimeline& timeline,
                                      timestamp_t timeshift_ns) {
  std::vector<WheelSlip> slips;
  size_t last_link = 0;
  for (const auto& [link, speed_error] : fused.slipping_links) {
    // What happened before the first image or after the last is of no use.
    if (link + 1 <= timeline.indices.front() ||
        link >= timeline.indices.back()) {
      continue;
    }
    if (slips.empty() || link > last_link + 2) slips.emplace_back();
    WheelSlip& slip = slips.back();
    if (slip.end_ns == 0) {
      slip.start_ns = timeline.times_ns[link] - timeshift_ns;
    }
    slip.end_ns = timeline.times_ns[link + 1] - timeshift_ns;
    if (std::abs(speed_error) > std::abs(slip.speed_error_m_s)) {
      slip.speed_error_m_s = speed_error;
    }
    last_link = link;
  }
  return slips;
}

void PredictDrift(const OdometryFusionProblem& problem, bool has_imu,
                  SensorSummary* summary) {
  double moving_s = 0.0;
  for (const OdometryLink& link : problem.links) {
    if (link.has_wheel && link.standstill == StandstillKind::kNone)
      moving_s += link.dt_s;
  }
  if (summary->distance_m <= 0.0 || moving_s <= 0.0) return;
  const double time = 100.0 * moving_s / summary->distance_m;
  const double walk = problem.imu_noise.gyroscope_noise_density;
  const double heading =
      std::hypot(walk * std::sqrt(time), summary->gyroscope_bias_sigma * time);
  if (has_imu) summary->drift_per_100m_deg = RadToDeg(heading);
  summary->drift_per_100m_m =
      100.0 * std::hypot(0.5 * heading, summary->wheel_scale_sigma);
}

}  // namespace adasfm
