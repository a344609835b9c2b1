// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/importer_options.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/colmap_ext/option_cases.h"

namespace adasfm {
namespace {

using Options = PriorImportOptions;

const std::vector<OptionCase<Options>>& Cases() {
  static const std::vector<OptionCase<Options>> cases = {
      ADASFM_OPTION("Priors.max_imu_gap_s", 0.2,
                    estimation.links.max_imu_gap_s),
      ADASFM_OPTION("Priors.max_wheel_gap_s", 0.5,
                    estimation.links.max_wheel_gap_s),
      ADASFM_OPTION("Priors.lateral_speed_noise_m_s_sqrt_hz", 0.1,
                    estimation.links.lateral_speed_noise),
      ADASFM_OPTION("Priors.vertical_speed_noise_m_s_sqrt_hz", 0.1,
                    estimation.links.vertical_speed_noise),
      ADASFM_OPTION("Priors.use_visual_rotations", 0,
                    estimation.use_visual_rotations),
      ADASFM_OPTION("Priors.estimate_time_shift", 1,
                    estimation.estimate_time_shift),
      ADASFM_OPTION("Priors.undo_gyroscope_filter", 0,
                    estimation.undo_gyroscope_filter),
      ADASFM_OPTION("Priors.calibrate_focal_lengths", 0, focal_lengths.enabled),
      ADASFM_OPTION("Priors.max_memory_gb", 2, max_memory_gb),
      ADASFM_OPTION("Priors.gravity_m_s2", 9.78,
                    estimation.fusion.gravity_m_s2),
      ADASFM_OPTION("Priors.gyroscope_bias_sigma_rad_s", 0.01,
                    estimation.fusion.gyroscope_bias_sigma),
      ADASFM_OPTION("Priors.accelerometer_bias_sigma_m_s2", 0.5,
                    estimation.fusion.accelerometer_bias_sigma),
      ADASFM_OPTION("Priors.wheel_scale_sigma", 0.02,
                    estimation.fusion.wheel_scale_sigma),
      ADASFM_OPTION("Priors.wheel_track_sigma", 0.2,
                    estimation.fusion.wheel_track_sigma),
      ADASFM_OPTION("Priors.wheel_curvature_sigma_per_m", 0.02,
                    estimation.fusion.wheel_curvature_sigma),
      ADASFM_OPTION("Priors.driving_direction_sigma_deg", 0,
                    estimation.fusion.driving_direction_sigma_deg),
      ADASFM_OPTION("Trajectory.sigma_m_per_m", 0.02, trajectory.sigma_m_per_m),
      ADASFM_OPTION("Trajectory.sigma_deg_per_m", 0.2,
                    trajectory.sigma_deg_per_m),
      ADASFM_OPTION("Trajectory.max_gap_s", 1, trajectory.max_gap_s),
      ADASFM_OPTION("Rig.rotation_sigma_deg", 0.1, rig.rotation_sigma_deg),
      ADASFM_OPTION("Rig.translation_sigma_m", 0.01, rig.translation_sigma_m),
      ADASFM_OPTION("Gnss.max_fix_gap_s", 5, positions.max_fix_gap_s),
      ADASFM_OPTION("Gnss.correlation_time_s", 60,
                    positions.correlation_time_s),
  };
  return cases;
}

TEST(ImporterOptionsTest, EachSetsItsOwnField) {
  ExpectEachSetsItsOwnField(Cases(), AddImporterOptions);
}

TEST(ImporterOptionsTest, WrongValuesAreNamedAsTheyAreTyped) {
  EXPECT_GT(ExpectWrongValuesAreNamed(Cases(), AddImporterOptions), 17);
}

TEST(ImporterOptionsTest, TheHelpNamesAll) {
  ExpectHelpNamesAll(Cases(), AddImporterOptions);
}

}  // namespace
}  // namespace adasfm
