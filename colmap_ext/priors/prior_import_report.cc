// SPDX-License-Identifier: BSD-3-Clause
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/priors/prior_importer.h"

namespace adasfm {
namespace {

std::vector<double> ToList(const Eigen::Ref<const Eigen::VectorXd>& vector) {
  return {vector.data(), vector.data() + vector.size()};
}

std::string ToText(const Eigen::Vector3d& vector) {
  std::ostringstream text;
  text.precision(3);
  text << vector.x() << " " << vector.y() << " " << vector.z();
  return text.str();
}

std::string ImuLines(const SensorSummary& summary) {
  std::ostringstream text;
  text.precision(4);
  text << "IMU                 " << summary.imu_rate_hz << " Hz, "
       << summary.num_imu_gaps << " gaps (longest " << summary.max_imu_gap_s
       << " s)\n"
       << "gyroscope bias      " << ToText(summary.gyroscope_bias) << " +- "
       << summary.gyroscope_bias_sigma << " rad/s\n"
       << "  of each axis      "
       << ToText(summary.gyroscope_bias_covariance.diagonal().cwiseSqrt())
       << " rad/s, 1 sigma\n"
       << "accelerometer bias  " << ToText(summary.accelerometer_bias) << " +- "
       << summary.accelerometer_bias_sigma << " m/s^2\n"
       << "gravity             " << ToText(summary.first_gravity_in_cam)
       << " in the first camera\n"
       << "standstill          " << summary.standstill_s << " s\n";
  if (summary.gyroscope_lag_s > 0.0) {
    text << "gyroscope filter    low-pass of " << summary.gyroscope_lag_s
         << " s undone\n";
  }
  return text.str();
}

std::string PositionLines(const PriorImport& import) {
  std::ostringstream text;
  text << "positions           " << import.num_fixes << " fixes, "
       << import.num_fixes_outside << " of them before or after the images; "
       << import.tables.positions.size() << " priors\n";
  for (const auto& [reason, count] : import.num_fixes_left_out) {
    text << "  left out          " << count << ": " << reason << "\n";
  }
  return text.str();
}

std::string WheelLines(const SensorSummary& summary) {
  std::ostringstream text;
  text.precision(4);
  text << "wheels              " << summary.wheel_rate_hz << " Hz, "
       << summary.num_wheel_gaps << " gaps (longest " << summary.max_wheel_gap_s
       << " s), scale " << summary.wheel_scale << " +- "
       << summary.wheel_scale_sigma << ", " << summary.wheel_delay_s << " +- "
       << summary.wheel_delay_sigma_s << " s behind the IMU\n"
       << "driving direction   " << summary.driving_direction_deg.x()
       << " left, " << summary.driving_direction_deg.y()
       << " down of T_imu_wheel's, +- "
       << summary.driving_direction_sigma_deg.x() << " and "
       << summary.driving_direction_sigma_deg.y() << " deg\n"
       << "distance            " << summary.distance_m << " m, "
       << summary.wheel_slips.size() << " slips\n";
  for (const WheelSlip& slip : summary.wheel_slips) {
    text << "  slip              " << slip.start_ns << " to " << slip.end_ns
         << " ns, " << slip.speed_error_m_s << " m/s off\n";
  }
  text << "expected drift      " << summary.drift_per_100m_m << " m";
  if (summary.drift_per_100m_deg > 0.0) {
    text << " and " << summary.drift_per_100m_deg << " deg";
  }
  text << " per 100 m\n";
  return text.str();
}

}  // namespace

std::string FormatPriorImport(const PriorImport& import) {
  const SensorSummary& summary = import.summary;
  std::ostringstream text;
  text.precision(4);
  if (import.num_fixes > 0 && summary.num_priors == 0) {
    text << "images              " << summary.num_images << " with times\n"
         << PositionLines(import);
    for (const std::string& warning : import.warnings) {
      text << "WARNING: " << warning << "\n";
    }
    return text.str();
  }
  text << "images              " << summary.num_images << " with times, "
       << summary.num_images_in_logs << " inside the logs\n"
       << "priors              " << summary.num_priors << " ("
       << 100.0 * summary.prior_ratio << " % of consecutive images)\n"
       << "two-view rotations  " << import.num_visual_rotations << "\n"
       << "time shift          " << summary.timeshift_cam_imu_s
       << (summary.timeshift_was_corrected ? " s, vision added "
                                           : " s, vision would add ")
       << summary.visual_timeshift_correction_s << " s\n";
  if (summary.unexplained_rotation.is_conclusive) {
    const UnexplainedRotation& rotation = summary.unexplained_rotation;
    text << "gyroscope, vision   turn by " << rotation.turning_deg
         << " deg a photo, differ by " << rotation.residual_deg
         << ", vision errs by " << rotation.visual_error_deg
         << "; times between photos err by " << rotation.interval_time_sigma_s
         << " s\n";
  }
  if (summary.imu_rate_hz > 0.0) text << ImuLines(summary);
  text << "noise / stated      gyroscope " << summary.gyroscope_noise_factor
       << ", accelerometer " << summary.accelerometer_noise_factor
       << ", wheels " << summary.wheel_speed_noise_factor << " (speed), "
       << summary.wheel_yaw_noise_factor << " (yaw rate)\n";
  if (summary.length_drift_ratio > 0.0) {
    text << "lengths             err alike for seconds by "
         << 100.0 * summary.length_drift_ratio << " %\n";
  }
  if (summary.wheel_rate_hz > 0.0) text << WheelLines(summary);
  if (import.num_fixes > 0) text << PositionLines(import);
  for (const std::string& warning : import.warnings) {
    text << "WARNING: " << warning << "\n";
  }
  return text.str();
}

std::string PriorImportToJson(const PriorImport& import) {
  const SensorSummary& summary = import.summary;
  nlohmann::ordered_json json = {
      {"num_images", summary.num_images},
      {"num_images_in_logs", summary.num_images_in_logs},
      {"num_images_without_time", import.num_images_without_time},
      {"num_priors", summary.num_priors},
      {"prior_ratio", summary.prior_ratio},
      {"num_visual_rotations", import.num_visual_rotations},
      {"timeshift_cam_imu_s", summary.timeshift_cam_imu_s},
      {"visual_timeshift_correction_s", summary.visual_timeshift_correction_s},
      {"timeshift_was_corrected", summary.timeshift_was_corrected},
      {"wheel_clock_shift_s", summary.wheel_clock_shift_s},
      {"imu_was_left_out", summary.imu_was_left_out},
      {"rotation_turning_deg", summary.unexplained_rotation.turning_deg},
      {"rotation_residual_deg", summary.unexplained_rotation.residual_deg},
      {"rotation_visual_error_deg",
       summary.unexplained_rotation.visual_error_deg},
      {"interval_time_sigma_s",
       summary.unexplained_rotation.interval_time_sigma_s},
      {"gyroscope_lag_s", summary.gyroscope_lag_s},
      {"gyroscope_delay_s", summary.gyroscope_delay_s},
      {"imu_rate_hz", summary.imu_rate_hz},
      {"num_imu_gaps", summary.num_imu_gaps},
      {"max_imu_gap_s", summary.max_imu_gap_s},
      {"standstill_s", summary.standstill_s},
      {"gyroscope_bias_rad_s", ToList(summary.gyroscope_bias)},
      {"gyroscope_bias_sigma_rad_s", summary.gyroscope_bias_sigma},
      {"gyroscope_bias_covariance_rad2_s2",
       ToList(summary.gyroscope_bias_covariance.reshaped())},
      {"accelerometer_bias_m_s2", ToList(summary.accelerometer_bias)},
      {"accelerometer_bias_sigma_m_s2", summary.accelerometer_bias_sigma},
      {"noise_over_stated",
       {{"gyroscope", summary.gyroscope_noise_factor},
        {"accelerometer", summary.accelerometer_noise_factor},
        {"wheel_speed", summary.wheel_speed_noise_factor},
        {"wheel_yaw_rate", summary.wheel_yaw_noise_factor}}},
      {"first_gravity_in_cam", ToList(summary.first_gravity_in_cam)},
      {"wheel_rate_hz", summary.wheel_rate_hz},
      {"num_wheel_gaps", summary.num_wheel_gaps},
      {"max_wheel_gap_s", summary.max_wheel_gap_s},
      {"wheel_scale", summary.wheel_scale},
      {"wheel_scale_sigma", summary.wheel_scale_sigma},
      {"wheel_persistence", summary.wheel_persistence},
      {"length_drift_ratio", summary.length_drift_ratio},
      {"wheel_delay_s", summary.wheel_delay_s},
      {"wheel_delay_sigma_s", summary.wheel_delay_sigma_s},
      {"driving_direction_deg", ToList(summary.driving_direction_deg)},
      {"driving_direction_sigma_deg",
       ToList(summary.driving_direction_sigma_deg)},
      {"distance_m", summary.distance_m},
      {"drift_per_100m_m", summary.drift_per_100m_m},
      {"drift_per_100m_deg", summary.drift_per_100m_deg},
      {"num_fixes", import.num_fixes},
      {"num_fixes_outside", import.num_fixes_outside},
      {"num_fixes_left_out", import.num_fixes_left_out},
      {"num_position_priors", import.tables.positions.size()},
      {"seconds", import.seconds},
      {"warnings", import.warnings}};
  json["wheel_slips"] = nlohmann::ordered_json::array();
  for (const WheelSlip& slip : summary.wheel_slips) {
    json["wheel_slips"].push_back({{"start_ns", slip.start_ns},
                                   {"end_ns", slip.end_ns},
                                   {"speed_error_m_s", slip.speed_error_m_s}});
  }
  json["log_faults"] = nlohmann::ordered_json::array();
  for (const LogFault& fault : import.log_faults) {
    json["log_faults"].push_back({{"path", fault.path},
                                  {"kind", FaultName(fault.kind)},
                                  {"unit", fault.unit},
                                  {"first", fault.first},
                                  {"last", fault.last},
                                  {"num_samples", fault.num_samples},
                                  {"duration_s", fault.duration_s}});
  }
  // Texts that are not UTF-8 (file names) must not end in an exception.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace adasfm
