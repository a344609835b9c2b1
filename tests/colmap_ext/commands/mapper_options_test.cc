// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/mapper_options.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/colmap_ext/option_cases.h"

namespace adasfm {
namespace {

using Options = MapOptions;

const std::vector<OptionCase<Options>>& Cases() {
  static const std::vector<OptionCase<Options>> cases = {
      ADASFM_OPTION("Mapper.min_num_visible_points", 30,
                    stage.local.registration.min_num_visible_points),
      ADASFM_OPTION("Mapper.max_reproj_error_px", 6,
                    stage.local.registration.max_reproj_error_px),
      ADASFM_OPTION("Mapper.use_global_candidate", 0,
                    stage.local.registration.use_global_candidate),
      ADASFM_OPTION("Mapper.use_priors_in_adjustment", 0,
                    stage.local.use_priors_in_adjustment),
      ADASFM_OPTION("Mapper.use_coarse_motions_in_parts", 1,
                    stage.local.use_coarse_motions_in_parts),
      ADASFM_OPTION("Mapper.keypoint_sigma_px", 1,
                    stage.local.keypoint_sigma_px),
      ADASFM_OPTION("Mapper.estimate_keypoint_sigma", 0,
                    stage.local.balance.estimate_keypoint_sigma),
      ADASFM_OPTION("Mapper.estimate_prior_sigmas", 0,
                    stage.local.balance.estimate_prior_sigmas),
      ADASFM_OPTION("Mapper.balance_priors", 0, stage.local.balance.enabled),
      ADASFM_OPTION("Mapper.filter_max_reproj_error_px", 3,
                    stage.local.filter_max_reproj_error_px),
      ADASFM_OPTION("Mapper.min_triangulation_angle_deg", 2,
                    stage.local.min_triangulation_angle_deg),
      ADASFM_OPTION("Mapper.refine_focal_length", 1, refine_focal_length),
      ADASFM_OPTION("Mapper.refine_principal_point", 1,
                    stage.refine.refine_principal_point),
      ADASFM_OPTION("Mapper.refine_extra_params", 1, refine_extra_params),
      ADASFM_OPTION("Mapper.max_num_parallel_parts", 2,
                    stage.max_num_parallel_parts),
      ADASFM_OPTION("Mapper.max_memory_gb", 2, stage.max_memory_gb),
      ADASFM_OPTION("Partition.max_part_size", 50,
                    stage.partition.cut.max_part_size),
      ADASFM_OPTION("Partition.min_part_size", 5,
                    stage.partition.cut.min_part_size),
      ADASFM_OPTION("Partition.min_overlap_ratio", 0.2,
                    stage.partition.min_overlap_ratio),
      ADASFM_OPTION("Partition.max_num_images_undivided", 100,
                    stage.partition.max_num_images_undivided),
      ADASFM_OPTION("Align.initial_threshold", 2,
                    stage.align.initial_threshold),
      ADASFM_OPTION("Align.threshold_increase", 0.3,
                    stage.align.threshold_increase),
      ADASFM_OPTION("Align.threshold_decrease", 0.05,
                    stage.align.threshold_decrease),
      ADASFM_OPTION("Align.min_inlier_ratio", 0.6,
                    stage.align.min_inlier_ratio),
      ADASFM_OPTION("Align.max_inlier_ratio", 0.8,
                    stage.align.max_inlier_ratio),
      ADASFM_OPTION("Align.adapt_threshold", 0, stage.align.adapt_threshold),
  };
  return cases;
}

TEST(MapperOptionsTest, EachSetsItsOwnField) {
  ExpectEachSetsItsOwnField(Cases(), AddMapperOptions);
}

TEST(MapperOptionsTest, WrongValuesAreNamedAsTheyAreTyped) {
  EXPECT_GT(ExpectWrongValuesAreNamed(Cases(), AddMapperOptions), 13);
}

TEST(MapperOptionsTest, TheHelpNamesAll) {
  ExpectHelpNamesAll(Cases(), AddMapperOptions);
}

}  // namespace
}  // namespace adasfm
