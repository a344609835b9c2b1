// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/global_options.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "tests/testing/colmap_ext/option_cases.h"

namespace adasfm {
namespace {

using Options = GlobalStageOptions;

const std::vector<OptionCase<Options>>& Cases() {
  static const std::vector<OptionCase<Options>> cases = {
      ADASFM_OPTION("Global.max_prior_time_gap_s", 0.7,
                    poses.augmentation.max_prior_time_gap_s),
      ADASFM_OPTION("Global.max_rotation_discrepancy_deg", 6,
                    poses.max_rotation_discrepancy_deg),
      ADASFM_OPTION("Global.min_triangulation_angle_deg", 4,
                    structure.triangulation.min_triangulation_angle_deg),
      ADASFM_OPTION("Global.max_epipolar_error_px", 3,
                    refinement.max_epipolar_error_px),
      ADASFM_OPTION("Global.max_memory_gb", 2, max_memory_gb),
      ADASFM_OPTION("Global.num_threads", 1, num_threads),
      ADASFM_OPTION("Global.min_num_inliers", 20, poses.min_num_inliers),
      ADASFM_OPTION("Global.camera_imu_sigma_deg", 2,
                    poses.camera_imu_rotation.sigma_deg),
      ADASFM_OPTION("Global.wheel_scale_sigma", 0.02, poses.chain.scale_sigma),
      ADASFM_OPTION("Global.gyro_bias_sigma_rad_s", 0.001,
                    poses.chain.gyro_bias_sigma_rad_s),
      ADASFM_OPTION("Global.loop_significance", 1e-4, poses.loops.significance),
      ADASFM_OPTION("Global.max_sequence_gap", 5, poses.loops.max_sequence_gap),
      ADASFM_OPTION("Global.max_track_length", 20, structure.max_track_length),
      ADASFM_OPTION("Global.ba_keypoint_sigma_px", 0.7,
                    structure.bundle.keypoint_sigma_px),
      ADASFM_OPTION("Global.write_pose_priors", 1, write_pose_priors),
      ADASFM_OPTION("Global.pose_prior_sigma", 0.7, pose_prior_sigma),
      ADASFM_OPTION("Global.ba_refine_focal_length", 1,
                    structure.bundle.refine_focal_length),
      ADASFM_OPTION("Global.calibrate_focal_lengths", 0, focal_lengths.enabled),
      ADASFM_OPTION("Global.refine_unknown_focal_length", 0,
                    structure.refine_unknown_focal_length),
      ADASFM_OPTION("Global.min_num_matches", 30, refinement.min_num_matches),
      ADASFM_OPTION("Global.use_sdp_start", 1, poses.rotations.use_sdp_start),
      ADASFM_OPTION("Global.use_loop_gating", 0, poses.loops.enabled),
      ADASFM_OPTION("Global.split_unconfirmed_closures", 0,
                    poses.loops.split_unconfirmed_closures),
      ADASFM_OPTION("Global.use_visual_odometry", 0, poses.use_visual_odometry),
      ADASFM_OPTION("Global.refine_relative_poses", 0,
                    poses.relative_poses.enabled),
      ADASFM_OPTION("Global.correct_camera_imu_rotation", 0,
                    poses.camera_imu_rotation.enabled),
      ADASFM_OPTION("Global.refine_translations", 0,
                    poses.translations.enabled),
      ADASFM_OPTION("Global.use_augmentation", 0, poses.augmentation.enabled),
      ADASFM_OPTION("Global.use_metric_lengths", 0,
                    poses.augmentation.use_metric_lengths),
      ADASFM_OPTION("Global.refine_positions", 0, poses.positions.refine),
      ADASFM_OPTION("Global.ba_use_priors", 0, structure.use_priors),
      ADASFM_OPTION("Global.refine_matches", 0, refinement.enabled),
  };
  return cases;
}

TEST(GlobalOptionsTest, EachSetsItsOwnField) {
  ExpectEachSetsItsOwnField(Cases(), AddGlobalOptions);
}

TEST(GlobalOptionsTest, WrongValuesAreNamedAsTheyAreTyped) {
  EXPECT_GT(ExpectWrongValuesAreNamed(Cases(), AddGlobalOptions), 14);
}

TEST(GlobalOptionsTest, TheHelpNamesAll) {
  ExpectHelpNamesAll(Cases(), AddGlobalOptions);
}

TEST(GlobalOptionsTest, OldNamesAreTaken) {
  GlobalStageOptions stage;
  testing::internal::CaptureStderr();
  EXPECT_TRUE(ParseWords<GlobalStageOptions>(
                  {"--AdaSfmGlobal.use_visual_steps=0",
                   "--AdaSfmGlobal.camera_mount_sigma_deg", "2"},
                  AddGlobalOptions, &stage)
                  .ok());
  const std::string notes = testing::internal::GetCapturedStderr();
  EXPECT_FALSE(stage.poses.use_visual_odometry);
  EXPECT_EQ(stage.poses.camera_imu_rotation.sigma_deg, 2.0);
  EXPECT_NE(notes.find("--AdaSfmGlobal.use_visual_steps is "
                       "--AdaSfmGlobal.use_visual_odometry now"),
            std::string::npos)
      << notes;
  // Old names in a project file, too.
  const std::string path = testing::TempDir() + "/old_names.ini";
  std::ofstream(path) << "[AdaSfmGlobal]\ncamera_mount_sigma_deg=0.5\n";
  EXPECT_TRUE(ParseWords<GlobalStageOptions>({"--project_path", path},
                                             AddGlobalOptions, &stage)
                  .ok());
  EXPECT_EQ(stage.poses.camera_imu_rotation.sigma_deg, 0.5);
}

}  // namespace
}  // namespace adasfm
