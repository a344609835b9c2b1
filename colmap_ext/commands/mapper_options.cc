// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/mapper_options.h"

#include <string>

namespace adasfm {
namespace {

void AddPartitionOptions(MapperStageOptions* options, CommandOptions* command) {
  PartitionPlanOptions& partition = options->partition;
  command->AddDefault("AdaSfmPartition.max_part_size",
                      &partition.cut.max_part_size,
                      "images of a part before the overlap");
  command->AddDefault("AdaSfmPartition.min_part_size",
                      &partition.cut.min_part_size,
                      "smaller pieces join a neighbour");
  command->AddDefault("AdaSfmPartition.min_overlap_ratio",
                      &partition.flood_fill.min_overlap_ratio,
                      "share of a part that other parts have too");
  command->AddDefault("AdaSfmPartition.max_num_images_undivided",
                      &partition.max_num_images_undivided,
                      "up to this many images the scene is one part");
}

void AddAlignOptions(AlignSimilarityOptions* align, CommandOptions* command) {
  command->AddDefault("AdaSfmAlign.initial_threshold",
                      &align->initial_threshold,
                      "tau_init: first threshold [m, or median distances of "
                      "neighbouring images]");
  command->AddDefault("AdaSfmAlign.threshold_increase",
                      &align->threshold_increase,
                      "alpha_inc: step by which it rises [as tau_init]");
  command->AddDefault("AdaSfmAlign.threshold_decrease",
                      &align->threshold_decrease,
                      "alpha_dec: step by which it falls [as tau_init]");
  command->AddDefault("AdaSfmAlign.min_threshold", &align->min_threshold,
                      "no threshold falls below this [as tau_init]");
  command->AddDefault("AdaSfmAlign.min_inlier_ratio", &align->min_inlier_ratio,
                      "r_min: a part below it is not merged");
  command->AddDefault("AdaSfmAlign.max_inlier_ratio", &align->max_inlier_ratio,
                      "r_max: from it on the threshold is lowered");
  command->AddDefault("AdaSfmAlign.max_num_iterations",
                      &align->max_num_iterations, "thresholds tried at most");
  command->AddDefault(
      "AdaSfmAlign.adapt_threshold", &align->adapt_threshold,
      "let the threshold rise and fall; 0: tau_init is used as it is");
}

}  // namespace

void AddMapperOptions(MapOptions* options, CommandOptions* command) {
  LocalMapperOptions& local = options->stage.local;
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmMapper." + name, value, help);
  };
  add("min_num_visible_points", &local.registration.min_num_visible_points,
      "v_p: points that an image must see");
  add("max_reproj_error_px", &local.registration.max_reproj_error_px,
      "inliers of a candidate pose [px]");
  add("use_global_candidate", &local.registration.use_global_candidate,
      "coarse poses as candidates beside P3P");
  add("use_priors_in_adjustment", &local.use_priors_in_adjustment,
      "sensor priors as terms of the bundle adjustment");
  add("use_coarse_motions_in_parts", &local.use_coarse_motions_in_parts,
      "the coarse motions of all pairs as terms of the parts' bundle "
      "adjustments (the paper's eq. 8)");
  add("keypoint_sigma_px", &local.keypoint_sigma_px,
      "1 sigma of keypoints, weighs priors [px]");
  add("estimate_keypoint_sigma", &local.balance.estimate_keypoint_sigma,
      "the last refinement takes the keypoint sigma from the residuals");
  add("estimate_prior_sigmas", &local.balance.estimate_prior_sigmas,
      "and lowers the priors' sigmas that the residuals refute");
  add("balance_priors", &local.balance.enabled,
      "raise the keypoint sigma until the priors agree within their "
      "covariance");
  add("max_prior_chi2", &local.balance.max_mean_square,
      "mean squared whitened residual that priors may have");
  add("max_keypoint_sigma_factor", &local.balance.max_sigma_factor,
      "largest factor by which the keypoint sigma is raised");
  add("filter_max_reproj_error_px", &local.filter_max_reproj_error_px,
      "observations beyond it, and beyond four sigmas of their noise, are "
      "removed [px]");
  add("min_triangulation_angle_deg", &local.min_triangulation_angle_deg,
      "points below it are removed [deg]");
  add("global_adjustment_growth", &local.global_adjustment_growth,
      "a part is adjusted as a whole when it has grown by this factor");
  add("refine_focal_length", &options->refine_focal_length,
      "adjust focal lengths at the end: 0, 1, or -1: when they are not known");
  add("refine_principal_point", &options->stage.refine.refine_principal_point,
      "adjust principal points at the end");
  add("refine_extra_params", &options->refine_extra_params,
      "adjust distortion at the end: 0, 1, or -1: when the focal length is not "
      "known");
  add("max_num_parallel_parts", &options->stage.max_num_parallel_parts,
      "parts at a time; -1: as threads and memory allow");
  add("max_memory_gb", &options->stage.max_memory_gb,
      "for the parts that run at the same time, and for the refinement, which "
      "cuts points to keep to it and does not begin where the scene may take "
      "more [GB]; -1: parts take 70 % of what is available");
  command->AddDefault("num_threads", &options->stage.num_threads,
                      "threads; -1: all of the machine's");
  AddPartitionOptions(&options->stage, command);
  AddAlignOptions(&options->stage.align, command);
}

}  // namespace adasfm
