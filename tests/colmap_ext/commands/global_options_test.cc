// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/global_options.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "tests/testing/colmap_ext/option_cases.h"

namespace adasfm {
namespace {

using GlobalCase = OptionCase<GlobalStageOptions>;

#define OPTION(name, value, member)                                            \
  {                                                                            \
    "AdaSfmGlobal." name, value,                                               \
        [](const GlobalStageOptions& stage) -> double { return stage.member; } \
  }

const std::vector<GlobalCase>& Cases() {
  static const std::vector<GlobalCase> cases = {
      OPTION("max_prior_time_gap_s", 0.7,
             poses.augmentation.max_prior_time_gap_s),
      OPTION("max_rotation_discrepancy_deg", 6,
             poses.max_rotation_discrepancy_deg),
      OPTION("min_triangulation_angle_deg", 4,
             structure.triangulation.min_triangulation_angle_deg),
      OPTION("max_epipolar_error_px", 3, refinement.max_epipolar_error_px),
      OPTION("max_memory_gb", 2, max_memory_gb),
      OPTION("num_threads", 1, num_threads),
      OPTION("min_num_inliers", 20, poses.min_num_inliers),
      OPTION("num_rotation_rounds", 1, poses.num_rotation_rounds),
      OPTION("camera_imu_max_num_steps", 5, poses.camera_mount.max_num_steps),
      OPTION("camera_imu_sigma_deg", 2, poses.camera_mount.sigma_deg),
      OPTION("camera_imu_min_sigma_deg", 0.2, poses.camera_mount.min_sigma_deg),
      OPTION("camera_imu_min_num_sigmas", 3, poses.camera_mount.min_num_sigmas),
      OPTION("wheel_scale_sigma", 0.02, poses.chain.scale_sigma),
      OPTION("gyro_bias_sigma_rad_s", 0.001, poses.chain.gyro_bias_sigma_rad_s),
      OPTION("visual_odometry_length_error", 0.2,
             poses.visual_steps.length_error_ratio),
      OPTION("loop_significance", 1e-4, poses.loops.significance),
      OPTION("loop_pair_angle_sigma_deg", 1, poses.loops.pair_angle_sigma_deg),
      OPTION("loop_pair_length_log_sigma", 0.1,
             poses.loops.pair_length_log_sigma),
      OPTION("loop_unit_log_sigma", 0.2, poses.loops.unit_log_sigma),
      OPTION("max_num_position_iterations", 7,
             poses.positions.max_num_iterations),
      OPTION("max_sequence_gap", 5, poses.loops.max_sequence_gap),
      OPTION("closure_min_turn_deg", 40, poses.loops.min_turn_deg),
      OPTION("min_angle_floor_deg", 2, structure.min_angle_floor_deg),
      OPTION("min_num_points_per_image", 10,
             structure.min_num_points_per_image),
      OPTION("min_track_length", 2, structure.tracks.min_track_length),
      OPTION("max_track_length", 20, structure.tracks.max_track_length),
      OPTION("min_num_tracks_per_image", 10,
             structure.tracks.min_num_tracks_per_image),
      OPTION("num_rounds", 1, structure.num_rounds),
      OPTION("keyframe_min_num_images", 10, structure.keyframes.min_num_images),
      OPTION("keyframe_stride", 2, structure.keyframes.stride),
      OPTION("final_max_reproj_error_px", 3,
             structure.final_max_reproj_error_px),
      OPTION("early_function_tolerance", 0.01,
             structure.early_function_tolerance),
      OPTION("ba_keypoint_sigma_px", 0.7, structure.bundle.keypoint_sigma_px),
      OPTION("ba_estimate_keypoint_sigma", 0,
             structure.balance.estimate_keypoint_sigma),
      OPTION("write_pose_priors", 1, write_pose_priors),
      OPTION("pose_prior_sigma", 0.7, pose_prior_sigma),
      OPTION("ba_refine_focal_length", 1, structure.bundle.refine_focal_length),
      OPTION("calibrate_focal_lengths", 0, focal_lengths.enabled),
      OPTION("refine_unknown_focal_length", 0,
             structure.refine_unknown_focal_length),
      OPTION("min_num_matches", 30, refinement.min_num_matches),
      OPTION("use_sdp_start", 1, poses.rotations.use_sdp_start),
      OPTION("use_loop_gating", 0, poses.loops.enabled),
      OPTION("split_unconfirmed_closures", 0,
             poses.loops.split_unconfirmed_closures),
      OPTION("use_visual_odometry", 0, poses.visual_steps.enabled),
      OPTION("refine_relative_poses", 0, poses.relative_poses.enabled),
      OPTION("correct_camera_imu_rotation", 0, poses.camera_mount.enabled),
      OPTION("refine_translations", 0, poses.translations.enabled),
      OPTION("use_augmentation", 0, poses.augmentation.enabled),
      OPTION("use_metric_lengths", 0, poses.augmentation.use_metric_lengths),
      OPTION("refine_positions", 0, poses.positions.refine),
      OPTION("ba_use_priors", 0, structure.use_priors),
      OPTION("refine_matches", 0, refinement.enabled),
  };
  return cases;
}

#undef OPTION

TEST(GlobalOptionsTest, EachSetsItsOwnField) {
  ExpectEachSetsItsOwnField(Cases(), AddGlobalOptions);
}

TEST(GlobalOptionsTest, WrongValuesAreNamedAsTheyAreTyped) {
  EXPECT_GT(ExpectWrongValuesAreNamed(Cases(), AddGlobalOptions), 30);
}

TEST(GlobalOptionsTest, TheHelpNamesAll) {
  ExpectHelpNamesAll(Cases(), AddGlobalOptions);
}

TEST(GlobalOptionsTest, OldNamesAreTaken) {
  GlobalStageOptions stage;
  testing::internal::CaptureStderr();
  EXPECT_TRUE(ParseWords<GlobalStageOptions>(
                  {"--AdaSfmGlobal.visual_step_length_error=0.3",
                   "--AdaSfmGlobal.join_min_turn_deg", "40"},
                  AddGlobalOptions, &stage)
                  .ok());
  const std::string notes = testing::internal::GetCapturedStderr();
  EXPECT_EQ(stage.poses.visual_steps.length_error_ratio, 0.3);
  EXPECT_EQ(stage.poses.loops.min_turn_deg, 40.0);
  EXPECT_NE(notes.find("--AdaSfmGlobal.visual_step_length_error is "
                       "--AdaSfmGlobal.visual_odometry_length_error now"),
            std::string::npos)
      << notes;
  // Of a project file too.
  const std::string path = testing::TempDir() + "/old_names.ini";
  std::ofstream(path) << "[AdaSfmGlobal]\ncamera_mount_sigma_deg=0.5\n";
  EXPECT_TRUE(ParseWords<GlobalStageOptions>({"--project_path", path},
                                             AddGlobalOptions, &stage)
                  .ok());
  EXPECT_EQ(stage.poses.camera_mount.sigma_deg, 0.5);
}

}  // namespace
}  // namespace adasfm
