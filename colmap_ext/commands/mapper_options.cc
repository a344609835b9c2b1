// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/mapper_options.h"

#include <string>

namespace adasfm {
namespace {

void AddPartitionOptions(MapperStageOptions* options, CommandOptions* command) {
  PartitionPlanOptions& partition = options->partition;
  command->AddDefault(
      "AdaSfmPartition.max_part_size", &partition.cut.max_part_size,
      "largest number of images of a part, without the overlap; images of one "
      "place count as one");
  command->AddDefault("AdaSfmPartition.min_part_size",
                      &partition.cut.min_part_size,
                      "parts with fewer images are joined to a neighbour");
  command->AddDefault(
      "AdaSfmPartition.min_overlap_ratio", &partition.min_overlap_ratio,
      "tau_ot: smallest share of a part that other parts contain too");
  command->AddDefault(
      "AdaSfmPartition.max_num_images_undivided",
      &partition.max_num_images_undivided,
      "a scene with at most this many images, counted alike, is one part");
}

void AddAlignOptions(AlignSimilarityOptions* align, CommandOptions* command) {
  command->AddDefault("AdaSfmAlign.initial_threshold",
                      &align->initial_threshold,
                      "tau_init: initial inlier threshold [m, or median "
                      "distances of neighbouring images]");
  command->AddDefault(
      "AdaSfmAlign.threshold_increase", &align->threshold_increase,
      "alpha_inc: step of raising the inlier threshold [as tau_init]");
  command->AddDefault(
      "AdaSfmAlign.threshold_decrease", &align->threshold_decrease,
      "alpha_dec: step of lowering the inlier threshold [as tau_init]");
  command->AddDefault(
      "AdaSfmAlign.min_inlier_ratio", &align->min_inlier_ratio,
      "r_min: parts with a smaller inlier ratio are not merged");
  command->AddDefault(
      "AdaSfmAlign.max_inlier_ratio", &align->max_inlier_ratio,
      "r_max: inlier ratio from which the inlier threshold is lowered");
  command->AddDefault(
      "AdaSfmAlign.adapt_threshold", &align->adapt_threshold,
      "adapt the inlier threshold to the inlier ratio; 0: always use tau_init");
}

}  // namespace

void AddMapperOptions(MapOptions* options, CommandOptions* command) {
  LocalMapperOptions& local = options->stage.local;
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmMapper." + name, value, help);
  };
  add("min_num_visible_points", &local.registration.min_num_visible_points,
      "v_p: points that an image must see to be registered");
  add("max_reproj_error_px", &local.registration.max_reproj_error_px,
      "largest inlier error of a candidate pose [px]");
  add("use_global_candidate", &local.registration.use_global_candidate,
      "use coarse poses as candidates besides P3P");
  add("use_priors_in_adjustment", &local.use_priors_in_adjustment,
      "use sensor priors in the bundle adjustment");
  add("use_coarse_motions_in_parts", &local.use_coarse_motions_in_parts,
      "use the coarse relative poses of all pairs in the bundle adjustment of "
      "the parts (the paper's eq. 8)");
  add("keypoint_sigma_px", &local.keypoint_sigma_px,
      "1 sigma of keypoints, to weight vision against priors [px]");
  add("estimate_keypoint_sigma", &local.balance.estimate_keypoint_sigma,
      "estimate the keypoint sigma from the residuals in the last refinement");
  add("estimate_prior_sigmas", &local.balance.estimate_prior_sigmas,
      "lower too large prior sigmas in the last refinement (variance "
      "components)");
  add("balance_priors", &local.balance.enabled,
      "raise the keypoint sigma until the priors agree within their "
      "covariance");
  add("filter_max_reproj_error_px", &local.filter_max_reproj_error_px,
      "observations with an error above this, and above four noise sigmas, are "
      "removed [px]");
  add("min_triangulation_angle_deg", &local.min_triangulation_angle_deg,
      "smallest triangulation angle of a point [deg]");
  add("refine_focal_length", &options->refine_focal_length,
      "refine focal lengths at the end: 0, 1, or -1: if not marked as known in "
      "the database");
  add("refine_principal_point", &options->stage.refine.refine_principal_point,
      "refine principal points at the end");
  add("refine_extra_params", &options->refine_extra_params,
      "refine distortion at the end: 0, 1, or -1: if the focal length is not "
      "marked as known");
  add("max_num_parallel_parts", &options->stage.max_num_parallel_parts,
      "largest number of parts at a time; -1: as threads and memory allow");
  add("max_memory_gb", &options->stage.max_memory_gb,
      "memory limit of the parts at a time, and of the refinement; the mapper "
      "stops at the start if the refinement may need more [GB]; -1: 70 % of "
      "the available memory for the parts, no limit for the refinement");
  command->AddDefault("num_threads", &options->stage.num_threads,
                      "number of threads; -1: all of the machine");
  AddPartitionOptions(&options->stage, command);
  AddAlignOptions(&options->stage.align, command);
}

}  // namespace adasfm
