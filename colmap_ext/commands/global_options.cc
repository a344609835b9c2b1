// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/global_options.h"

#include <string>
#include <utility>

namespace adasfm {
namespace {

class GlobalOptionAdder {
 public:
  GlobalOptionAdder(GlobalStageOptions* stage, CommandOptions* command)
      : stage_(stage), command_(command) {}

  void AddPaper();
  void AddRotations();
  void AddCameraImuRotation();
  void AddLoops();
  void AddStructure();
  void AddMatches();
  void AddAblations();

 private:
  template <typename T>
  void Add(const std::string& name, T* value, const std::string& help) {
    command_->AddDefault("AdaSfmGlobal." + name, value, help);
  }

  GlobalStageOptions* stage_;
  CommandOptions* command_;
};

// Options from the paper.
void GlobalOptionAdder::AddPaper() {
  Add("max_prior_time_gap_s", &stage_->poses.augmentation.max_prior_time_gap_s,
      "eps_T: sensor priors over longer intervals become edges only if their "
      "covariance is small [s]");
  Add("max_rotation_discrepancy_deg",
      &stage_->poses.max_rotation_discrepancy_deg,
      "eps_R: pairs that differ more from the global rotations are removed "
      "[deg]");
  Add("min_triangulation_angle_deg",
      &stage_->structure.triangulation.min_triangulation_angle_deg,
      "smallest triangulation angle of a point [deg]");
  Add("max_epipolar_error_px", &stage_->refinement.max_epipolar_error_px,
      "eps_M: matches with a larger epipolar distance, summed over both views, "
      "are removed [px]");
  Add("write_pose_priors", &stage_->write_pose_priors,
      "write coarse positions and gravity to the table pose_priors of a COLMAP "
      "4 database, for global_mapper and pose_prior_mapper (0 or 1)");
  Add("pose_prior_sigma", &stage_->pose_prior_sigma,
      "1 sigma of a coarse position in pose_priors [m, or the model's unit]");
  Add("max_memory_gb", &stage_->max_memory_gb,
      "memory limit; a stage that may need more stops at the start [GB]; -1: "
      "only a warning if it may need more than is free");
  Add("num_threads", &stage_->num_threads,
      "number of threads; -1: all of the machine");
}

void GlobalOptionAdder::AddRotations() {
  Add("min_num_inliers", &stage_->poses.min_num_inliers,
      "pairs with fewer verified matches are not used");
}

void GlobalOptionAdder::AddCameraImuRotation() {
  Add("camera_imu_sigma_deg", &stage_->poses.camera_imu_rotation.sigma_deg,
      "prior 1 sigma of the rotation error of T_cam_imu, per axis [deg]");
}

void GlobalOptionAdder::AddLoops() {
  Add("wheel_scale_sigma", &stage_->poses.chain.scale_sigma,
      "1 sigma of the wheels' common scale error, as a ratio");
  Add("gyro_bias_sigma_rad_s", &stage_->poses.chain.gyro_bias_sigma_rad_s,
      "1 sigma of the remaining gyroscope bias, per axis, if the import does "
      "not state it [rad/s]");
  LoopClosureOptions* loops = &stage_->poses.loops;
  Add("loop_significance", &loops->significance,
      "probability that a consistency check (odometry or loop closures) "
      "rejects a true pair");
  Add("max_sequence_gap", &loops->max_sequence_gap,
      "pairs of images more than this many images apart in the order of "
      "capture are loop closures");
}

void GlobalOptionAdder::AddStructure() {
  Add("max_track_length", &stage_->structure.max_track_length,
      "longer tracks are reduced to this many images, evenly spread");
  Add("ba_keypoint_sigma_px", &stage_->structure.bundle.keypoint_sigma_px,
      "1 sigma of a keypoint, to weight vision against sensor priors [px]");
  Add("ba_refine_focal_length", &stage_->structure.bundle.refine_focal_length,
      "refine focal lengths in the bundle adjustment");
  Add("calibrate_focal_lengths", &stage_->focal_lengths.enabled,
      "first calibrate focal lengths that the database does not mark as known, "
      "from the verified pairs");
  Add("refine_unknown_focal_length",
      &stage_->structure.refine_unknown_focal_length,
      "refine focal lengths that the database does not mark as known if they "
      "were calibrated or contradict vision and sensors");
}

void GlobalOptionAdder::AddMatches() {
  Add("min_num_matches", &stage_->refinement.min_num_matches,
      "pairs with fewer remaining matches are removed");
}

// Switches to disable single steps.
void GlobalOptionAdder::AddAblations() {
  Add("use_sdp_start", &stage_->poses.rotations.use_sdp_start,
      "initialise rotation averaging by the SDP, as the paper does; 0: by a "
      "spanning tree");
  Add("use_loop_gating", &stage_->poses.loops.enabled,
      "remove false loop closures");
  Add("split_unconfirmed_closures",
      &stage_->poses.loops.split_unconfirmed_closures,
      "trajectory segments (with sensor priors, or images in order) joined "
      "only by loop closures at one place become separate models");
  Add("use_visual_odometry", &stage_->poses.use_visual_odometry,
      "use visual odometry for the consistency check of loop closures where "
      "sensors have no translation (0 or 1)");
  Add("refine_relative_poses", &stage_->poses.relative_poses.enabled,
      "refine relative poses by least squares");
  Add("correct_camera_imu_rotation", &stage_->poses.camera_imu_rotation.enabled,
      "correct the priors for a rotation error of T_cam_imu, estimated by "
      "vision");
  Add("refine_translations", &stage_->poses.translations.enabled,
      "re-estimate translation directions under the global rotations");
  Add("use_augmentation", &stage_->poses.augmentation.enabled,
      "add sensor edges and translations to the view graph");
  Add("use_metric_lengths", &stage_->poses.augmentation.use_metric_lengths,
      "use metric lengths of sensor translations; 0: unit vectors, as in the "
      "paper");
  Add("refine_positions", &stage_->poses.positions.refine,
      "refine positions at the end, weighting directions and lengths by their "
      "sigmas");
  Add("ba_use_priors", &stage_->structure.use_priors,
      "use sensor priors in the bundle adjustment");
  Add("refine_matches", &stage_->refinement.enabled,
      "rewrite the two-view geometries in the database");
}

}  // namespace

void AddGlobalOptions(GlobalStageOptions* stage, CommandOptions* command) {
  GlobalOptionAdder adder(stage, command);
  adder.AddPaper();
  adder.AddRotations();
  adder.AddCameraImuRotation();
  adder.AddLoops();
  adder.AddStructure();
  adder.AddMatches();
  adder.AddAblations();
  // Earlier names.
  const std::pair<const char*, const char*> old_names[] = {
      {"camera_mount_sigma_deg", "camera_imu_sigma_deg"},
      {"correct_camera_mount", "correct_camera_imu_rotation"},
      {"use_visual_steps", "use_visual_odometry"},
      {"split_unverified_joins", "split_unconfirmed_closures"}};
  for (const auto& [old_name, name] : old_names) {
    command->AddOldName(std::string("AdaSfmGlobal.") + old_name,
                        std::string("AdaSfmGlobal.") + name);
  }
}

}  // namespace adasfm
