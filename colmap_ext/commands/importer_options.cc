// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/importer_options.h"

#include <string>
#include <utility>

namespace adasfm {
namespace {

void AddFusionOptions(OdometryFusionOptions* fusion, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(std::string("AdaSfmPriors.") + name, value, help);
  };
  add("gravity_m_s2", &fusion->gravity_m_s2,
      "magnitude of the gravity vector [m/s^2]");
  add("gyroscope_bias_sigma_rad_s", &fusion->gyroscope_bias_sigma,
      "prior 1 sigma of the gyroscope bias, per axis [rad/s]");
  add("accelerometer_bias_sigma_m_s2", &fusion->accelerometer_bias_sigma,
      "prior 1 sigma of the accelerometer bias, per axis [m/s^2]");
  add("wheel_scale_sigma", &fusion->wheel_scale_sigma,
      "prior 1 sigma of the wheel scale [1 = 100 %]");
  add("wheel_track_sigma", &fusion->wheel_track_sigma,
      "prior 1 sigma of the scale of the track width [1 = 100 %]");
  add("wheel_curvature_sigma_per_m", &fusion->wheel_curvature_sigma,
      "prior 1 sigma of the path curvature caused by unequal wheels [1/m]");
  add("driving_direction_sigma_deg", &fusion->driving_direction_sigma_deg,
      "prior 1 sigma of the driving direction relative to T_imu_wheel [deg]; "
      "0: fixed");
}

void AddOldNames(CommandOptions* command) {
  // Earlier names.
  const std::pair<const char*, const char*> old_names[] = {
      {"gyroscope_bias_sigma", "gyroscope_bias_sigma_rad_s"},
      {"accelerometer_bias_sigma", "accelerometer_bias_sigma_m_s2"},
      {"wheel_curvature_sigma", "wheel_curvature_sigma_per_m"},
      {"wheel_mount_sigma_deg", "driving_direction_sigma_deg"},
      {"lateral_speed_noise", "lateral_speed_noise_m_s_sqrt_hz"},
      {"vertical_speed_noise", "vertical_speed_noise_m_s_sqrt_hz"}};
  for (const auto& [old_name, name] : old_names) {
    command->AddOldName(std::string("AdaSfmPriors.") + old_name,
                        std::string("AdaSfmPriors.") + name);
  }
}

// Adds options of trajectories, rigs and GNSS.
void AddOtherSources(PriorImportOptions* options, CommandOptions* command) {
  TrajectoryPriorOptions* trajectory = &options->trajectory;
  command->AddDefault("AdaSfmTrajectory.sigma_m_per_m",
                      &trajectory->sigma_m_per_m,
                      "error of the trajectory's translation between two "
                      "images, 1 sigma [m/m]");
  command->AddDefault(
      "AdaSfmTrajectory.sigma_deg_per_m", &trajectory->sigma_deg_per_m,
      "error of the trajectory's rotation between two images, 1 sigma [deg/m]");
  command->AddDefault("AdaSfmTrajectory.max_gap_s", &trajectory->max_gap_s,
                      "longest gap of the trajectory to interpolate [s]");
  command->AddDefault(
      "AdaSfmRig.rotation_sigma_deg", &options->rig.rotation_sigma_deg,
      "error of relative rotations in a rig, 1 sigma per axis [deg]");
  command->AddDefault(
      "AdaSfmRig.translation_sigma_m", &options->rig.translation_sigma_m,
      "error of relative positions in a rig, 1 sigma per axis [m]");
  PositionPriorOptions* positions = &options->positions;
  command->AddDefault("AdaSfmGnss.max_fix_gap_s", &positions->max_fix_gap_s,
                      "longest gap of the GNSS positions to interpolate [s]");
  command->AddDefault("AdaSfmGnss.correlation_time_s",
                      &positions->correlation_time_s,
                      "correlation time of the errors of GNSS positions [s]; "
                      "0: independent errors");
}

}  // namespace

void AddImporterOptions(PriorImportOptions* options, CommandOptions* command) {
  PriorEstimationOptions* estimation = &options->estimation;
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(std::string("AdaSfmPriors.") + name, value, help);
  };
  OdometryLinkOptions* links = &estimation->links;
  add("max_imu_gap_s", &links->max_imu_gap_s,
      "longest gap of the IMU log to bridge [s]");
  add("max_wheel_gap_s", &links->max_wheel_gap_s,
      "longest gap of the wheel log to bridge [s]");
  add("lateral_speed_noise_m_s_sqrt_hz", &links->lateral_speed_noise,
      "noise of the lateral speed of the wheel frame [m/s/sqrt(Hz)]");
  add("vertical_speed_noise_m_s_sqrt_hz", &links->vertical_speed_noise,
      "noise of the vertical speed of the wheel frame [m/s/sqrt(Hz)]");
  add("use_visual_rotations", &estimation->use_visual_rotations,
      "use two-view rotations to estimate the gyroscope bias and, without an "
      "IMU, to detect wheel slip (0 or 1)");
  add("estimate_time_shift", &estimation->estimate_time_shift,
      "add the estimated time shift between vision and gyroscope to "
      "timeshift_cam_imu: 0, 1, or -1: if significant and at most 0.15 s");
  add("undo_gyroscope_filter", &estimation->undo_gyroscope_filter,
      "undo a low-pass filter of the gyroscope log if the comparison with "
      "vision is significant (0 or 1)");
  add("calibrate_focal_lengths", &options->focal_lengths.enabled,
      "for two-view rotations, calibrate focal lengths that the database does "
      "not mark as known from the verified pairs (0 or 1)");
  add("max_memory_gb", &options->max_memory_gb,
      "memory limit; an import that may need more stops at the start [GB]; -1: "
      "only a warning if it may need more than is free");
  AddFusionOptions(&estimation->fusion, command);
  AddOtherSources(options, command);
  AddOldNames(command);
}

}  // namespace adasfm
