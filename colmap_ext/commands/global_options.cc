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
  void AddPositions();
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
      "sensor priors over longer times are edges only if their covariance is "
      "small [s]");
  Add("max_rotation_discrepancy_deg",
      &stage_->poses.max_rotation_discrepancy_deg,
      "pairs farther from the global rotations are removed [deg]");
  Add("min_triangulation_angle_deg",
      &stage_->structure.triangulation.min_triangulation_angle_deg,
      "least angle of a point's rays [deg]");
  Add("max_epipolar_error_px", &stage_->refinement.max_epipolar_error_px,
      "matches farther from their epipolar lines, both views together, are "
      "dropped [px]");
  Add("write_pose_priors", &stage_->write_pose_priors,
      "put coarse positions and gravity into the table pose_priors of a "
      "COLMAP 4 database, for global_mapper and pose_prior_mapper (0 or 1)");
  Add("pose_prior_sigma", &stage_->pose_prior_sigma,
      "1 sigma of a coarse position there [m, or the model's unit]");
  Add("max_memory_gb", &stage_->max_memory_gb,
      "an error, before the work, where the stage may take more [GB]; -1: a "
      "warning where it may take more than is free");
  Add("num_threads", &stage_->num_threads, "threads; -1: all of the machine's");
}

void GlobalOptionAdder::AddRotations() {
  Add("min_num_inliers", &stage_->poses.min_num_inliers,
      "pairs with fewer verified matches take no part");
  Add("num_rotation_rounds", &stage_->poses.num_rotation_rounds,
      "rounds of relative poses and rotations for pairs without odometry");
}

void GlobalOptionAdder::AddCameraImuRotation() {
  CameraImuRotationOptions* camera_imu = &stage_->poses.camera_imu_rotation;
  Add("camera_imu_max_num_steps", &camera_imu->max_num_steps,
      "pairs at most this many images apart tell the rotation between camera "
      "and "
      "IMU");
  Add("camera_imu_sigma_deg", &camera_imu->sigma_deg,
      "1 sigma of what T_cam_imu may be wrong by, per axis [deg]");
  Add("camera_imu_min_sigma_deg", &camera_imu->min_sigma_deg,
      "least error granted to what pairs say of it, per axis [deg]");
  Add("camera_imu_min_num_sigmas", &camera_imu->min_num_sigmas,
      "priors are corrected when it is off by so many sigmas");
}

void GlobalOptionAdder::AddLoops() {
  Add("wheel_scale_sigma", &stage_->poses.chain.scale_sigma,
      "1 sigma of the wheels' common scale error, as a ratio");
  Add("gyro_bias_sigma_rad_s", &stage_->poses.chain.gyro_bias_sigma_rad_s,
      "1 sigma of the gyroscope bias that is left, per axis, where the import "
      "does not state it [rad/s]");
  Add("visual_odometry_length_error",
      &stage_->poses.visual_odometry.length_error_ratio,
      "1 sigma of the drift of lengths where vision completes the odometry, as "
      "a ratio");
  LoopClosureOptions* loops = &stage_->poses.loops;
  Add("loop_significance", &loops->significance,
      "a true pair contradicts the odometry, or another loop, with this "
      "probability");
  Add("loop_pair_angle_sigma_deg", &loops->pair_angle_sigma_deg,
      "least error of a pair's rotation and direction, 1 sigma [deg]");
  Add("loop_pair_length_log_sigma", &loops->pair_length_log_sigma,
      "least error of a pair's length, 1 sigma of its logarithm");
  Add("loop_unit_log_sigma", &loops->unit_log_sigma,
      "error of the unit of a segment without metres, 1 sigma of its "
      "logarithm");
  Add("max_sequence_gap", &loops->max_sequence_gap,
      "images at most this far apart in the order of capture follow each "
      "other; pairs of others are loop closures");
  Add("closure_min_turn_deg", &loops->min_turn_deg,
      "joining two segments needs loop closures before and behind a turn of so "
      "much [deg]");
}

void GlobalOptionAdder::AddPositions() {
  Add("max_num_position_iterations",
      &stage_->poses.positions.max_num_iterations,
      "iterations of the translation averaging");
}

void GlobalOptionAdder::AddStructure() {
  Add("min_angle_floor_deg", &stage_->structure.min_angle_floor_deg,
      "least angle for images with few points [deg]");
  Add("min_num_points_per_image", &stage_->structure.min_num_points_per_image,
      "images with fewer points get some of smaller angles");
  Add("min_track_length", &stage_->structure.tracks.min_track_length,
      "images that a track must have");
  Add("max_track_length", &stage_->structure.tracks.max_track_length,
      "longer tracks keep so many images, evenly spread");
  Add("min_num_tracks_per_image",
      &stage_->structure.tracks.min_num_tracks_per_image,
      "tracks are taken while an image has fewer");
  Add("num_rounds", &stage_->structure.num_rounds,
      "rounds of triangulation and bundle adjustment");
  Add("final_max_reproj_error_px", &stage_->structure.final_max_reproj_error_px,
      "largest error of a point in the last round [px]; four sigmas of the "
      "keypoints' noise where that is more");
  Add("early_function_tolerance", &stage_->structure.early_function_tolerance,
      "rounds before the last end at this relative change of the cost");
  Add("keyframe_min_num_images", &stage_->structure.keyframes.min_num_images,
      "smaller components are adjusted with all images in all rounds");
  Add("keyframe_stride", &stage_->structure.keyframes.stride,
      "one image of so many sees points in the rounds before the last; 1: all");
  Add("ba_keypoint_sigma_px", &stage_->structure.bundle.keypoint_sigma_px,
      "1 sigma of a keypoint, against which sensor priors weigh [px]");
  Add("ba_estimate_keypoint_sigma",
      &stage_->structure.balance.estimate_keypoint_sigma,
      "the last round takes the keypoint sigma from the residuals");
  Add("ba_refine_focal_length", &stage_->structure.bundle.refine_focal_length,
      "adjust focal lengths too");
  Add("calibrate_focal_lengths", &stage_->focal_lengths.enabled,
      "find focal lengths that the database does not mark as known from the "
      "verified pairs before anything else");
  Add("refine_unknown_focal_length",
      &stage_->structure.refine_unknown_focal_length,
      "adjust focal lengths that the database does not mark as known, when "
      "vision and sensors show that they are wrong");
}

void GlobalOptionAdder::AddMatches() {
  Add("min_num_matches", &stage_->refinement.min_num_matches,
      "pairs with fewer matches are removed");
}

// Switches to disable single steps.
void GlobalOptionAdder::AddAblations() {
  Add("use_sdp_start", &stage_->poses.rotations.use_sdp_start,
      "start the rotations from the SDP, as the paper does; without it they "
      "start from a spanning tree");
  Add("use_loop_gating", &stage_->poses.loops.enabled,
      "remove false loop closures");
  Add("split_unconfirmed_closures",
      &stage_->poses.loops.split_unconfirmed_closures,
      "parts of a drive (with sensor priors, or images in order) that only "
      "loop closures at one place join become models of their own");
  Add("use_visual_odometry", &stage_->poses.visual_odometry.enabled,
      "vision completes the odometry that gates loops, where sensors have no "
      "position (0 or 1)");
  Add("refine_relative_poses", &stage_->poses.relative_poses.enabled,
      "least-squares relative poses");
  Add("correct_camera_imu_rotation", &stage_->poses.camera_imu_rotation.enabled,
      "take a wrong rotation of T_cam_imu out of the priors, by vision");
  Add("refine_translations", &stage_->poses.translations.enabled,
      "directions anew under the global rotations");
  Add("use_augmentation", &stage_->poses.augmentation.enabled,
      "sensor edges and translations in the view graph");
  Add("use_metric_lengths", &stage_->poses.augmentation.use_metric_lengths,
      "keep the sensors' lengths (0: the paper's unit vectors)");
  Add("refine_positions", &stage_->poses.positions.refine,
      "weigh directions and lengths by their own sigmas at the end");
  Add("ba_use_priors", &stage_->structure.use_priors,
      "sensor priors in the bundle adjustment");
  Add("refine_matches", &stage_->refinement.enabled,
      "rewrite the database's two-view geometries");
}

}  // namespace

void AddGlobalOptions(GlobalStageOptions* stage, CommandOptions* command) {
  GlobalOptionAdder adder(stage, command);
  adder.AddPaper();
  adder.AddRotations();
  adder.AddCameraImuRotation();
  adder.AddLoops();
  adder.AddPositions();
  adder.AddStructure();
  adder.AddMatches();
  adder.AddAblations();
  // Earlier names.
  const std::pair<const char*, const char*> old_names[] = {
      {"camera_mount_max_num_steps", "camera_imu_max_num_steps"},
      {"camera_mount_sigma_deg", "camera_imu_sigma_deg"},
      {"camera_mount_min_sigma_deg", "camera_imu_min_sigma_deg"},
      {"camera_mount_min_num_sigmas", "camera_imu_min_num_sigmas"},
      {"correct_camera_mount", "correct_camera_imu_rotation"},
      {"visual_step_length_error", "visual_odometry_length_error"},
      {"use_visual_steps", "use_visual_odometry"},
      {"join_min_turn_deg", "closure_min_turn_deg"},
      {"split_unverified_joins", "split_unconfirmed_closures"}};
  for (const auto& [old_name, name] : old_names) {
    command->AddOldName(std::string("AdaSfmGlobal.") + old_name,
                        std::string("AdaSfmGlobal.") + name);
  }
}

}  // namespace adasfm
