// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/mapper_options.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/testing/colmap_ext/option_cases.h"

namespace adasfm {
namespace {

using MapperCase = OptionCase<MapOptions>;

#define OPTION(name, value, member)                                        \
  {                                                                        \
    "AdaSfm" name, value,                                                  \
        [](const MapOptions& options) -> double { return options.member; } \
  }

const std::vector<MapperCase>& Cases() {
  static const std::vector<MapperCase> cases = {
      OPTION("Mapper.min_num_visible_points", 30,
             stage.local.registration.min_num_visible_points),
      OPTION("Mapper.max_reproj_error_px", 6,
             stage.local.registration.max_reproj_error_px),
      OPTION("Mapper.use_global_candidate", 0,
             stage.local.registration.use_global_candidate),
      OPTION("Mapper.use_priors_in_adjustment", 0,
             stage.local.use_priors_in_adjustment),
      OPTION("Mapper.keypoint_sigma_px", 1, stage.local.keypoint_sigma_px),
      OPTION("Mapper.estimate_keypoint_sigma", 0,
             stage.local.balance.estimate_keypoint_sigma),
      OPTION("Mapper.estimate_prior_sigmas", 0,
             stage.local.balance.estimate_prior_sigmas),
      OPTION("Mapper.balance_priors", 0, stage.local.balance.enabled),
      OPTION("Mapper.max_prior_chi2", 2, stage.local.balance.max_mean_square),
      OPTION("Mapper.max_keypoint_sigma_factor", 8,
             stage.local.balance.max_sigma_factor),
      OPTION("Mapper.filter_max_reproj_error_px", 3,
             stage.local.filter_max_reproj_error_px),
      OPTION("Mapper.min_triangulation_angle_deg", 2,
             stage.local.min_triangulation_angle_deg),
      OPTION("Mapper.global_adjustment_growth", 2,
             stage.local.global_adjustment_growth),
      OPTION("Mapper.refine_focal_length", 1, refine_focal_length),
      OPTION("Mapper.refine_principal_point", 1,
             stage.refine.refine_principal_point),
      OPTION("Mapper.refine_extra_params", 1, refine_extra_params),
      OPTION("Mapper.max_num_parallel_parts", 2, stage.max_num_parallel_parts),
      OPTION("Mapper.max_memory_gb", 2, stage.max_memory_gb),
      OPTION("Partition.max_part_size", 50, stage.partition.cut.max_part_size),
      OPTION("Partition.min_part_size", 5, stage.partition.cut.min_part_size),
      OPTION("Partition.min_overlap_ratio", 0.2,
             stage.partition.flood_fill.min_overlap_ratio),
      OPTION("Partition.max_num_images_undivided", 100,
             stage.partition.max_num_images_undivided),
      OPTION("Align.initial_threshold", 2, stage.align.initial_threshold),
      OPTION("Align.threshold_increase", 0.3, stage.align.threshold_increase),
      OPTION("Align.threshold_decrease", 0.05, stage.align.threshold_decrease),
      OPTION("Align.min_threshold", 0.2, stage.align.min_threshold),
      OPTION("Align.min_inlier_ratio", 0.6, stage.align.min_inlier_ratio),
      OPTION("Align.max_inlier_ratio", 0.8, stage.align.max_inlier_ratio),
      OPTION("Align.max_num_iterations", 10, stage.align.max_num_iterations),
      OPTION("Align.adapt_threshold", 0, stage.align.adapt_threshold),
  };
  return cases;
}

#undef OPTION

TEST(MapperOptionsTest, EachSetsItsOwnField) {
  ExpectEachSetsItsOwnField(Cases(), AddMapperOptions);
}

TEST(MapperOptionsTest, WrongValuesAreNamedAsTheyAreTyped) {
  EXPECT_GT(ExpectWrongValuesAreNamed(Cases(), AddMapperOptions), 18);
}

TEST(MapperOptionsTest, TheHelpNamesAll) {
  ExpectHelpNamesAll(Cases(), AddMapperOptions);
}

}  // namespace
}  // namespace adasfm
