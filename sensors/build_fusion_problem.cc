// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/build_fusion_problem.h"

#include "core/so3.h"
#include "sensors/bridged_holes.h"
#include "sensors/seen_wheel_yaw.h"
#include "sensors/smoother/initial_odometry.h"

namespace adasfm {
namespace {

// The mean rate at standstills, else the bias from vision.
ImuBias FirstBias(const std::vector<OdometryLink>& links,
                  const VisionUse& vision) {
  ImuBias bias;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double time = 0.0;
  for (const OdometryLink& link : links) {
    if (!link.has_imu || link.standstill == StandstillKind::kNone) continue;
    sum += LogSo3(link.imu.delta_rotation);
    time += link.dt_s;
  }
  if (time > 0.5) {
    bias.gyroscope = sum / time;
  } else if (vision.has_bias) {
    bias.gyroscope = vision.bias;
  }
  return bias;
}

}  // namespace

FusionInput BuildFusionProblem(const PriorEstimationOptions& options,
                               const SensorCalibration& calibration,
                               const std::vector<timestamp_t>& times_ns,
                               const MotionLogs& logs,
                               const VisionUse& vision) {
  FusionInput input;
  OdometryTimeline& timeline = input.timeline;
  OdometryFusionProblem& problem = input.problem;
  timeline = BuildTimeline(times_ns, logs);
  problem.imu_from_wheel = calibration.imu_from_wheel;
  problem.imu_noise = calibration.imu_noise;
  problem.links = BuildOdometryLinks(timeline.times_ns, logs, calibration,
                                     ImuBias(), options.links);
  const ImuBias bias = FirstBias(problem.links, vision);
  if (bias.gyroscope != Eigen::Vector3d::Zero()) {
    // Preintegrated about the right bias, first-order corrections stay small.
    problem.links = BuildOdometryLinks(timeline.times_ns, logs, calibration,
                                       bias, options.links);
  }
  AddHoleUncertainty(logs, timeline.times_ns,
                     calibration.imu_from_wheel.rotation, &problem.links);
  if (options.use_visual_rotations) {
    input.num_seen_slips = UseSeenWheelYaw(
        vision.rotations, vision.timeshift_ns,
        calibration.cam_from_imu.rotation, timeline, options.fusion, &problem);
  }
  if (vision.has_bias) {
    problem.prior_gyroscope_bias = vision.bias;
    problem.prior_gyroscope_bias_sigma = vision.bias_sigma;
  }
  problem.initial_states = EstimateInitialOdometry(
      problem.links, problem.imu_from_wheel, options.fusion.gravity_m_s2, bias);
  return input;
}

}  // namespace adasfm
