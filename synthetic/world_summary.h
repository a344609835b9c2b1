// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "synthetic/synthetic_world.h"

namespace adasfm {

// Figures of a world, counted from its images, pairs and logs.
struct SyntheticWorldSummary {
  int num_images = 0;
  double driven_m = 0.0;
  double duration_s = 0.0;             // from the first image to the last
  double standing_s = 0.0;             // in stops and turns on the spot
  int num_images_without_texture = 0;  // fewer than 15 keypoints
  double mean_num_keypoints = 0.0;     // of the other images
  // Share of an image's keypoints whose landmark the next image sees too.
  double mean_overlap = 0.0;
  double moving_keypoint_ratio = 0.0;
  // Of the inlier matches of true pairs.
  double moving_match_ratio = 0.0;
  int num_pairs = 0;
  // True pairs of images more than ten apart.
  int num_revisit_pairs = 0;
  double alias_pair_ratio = 0.0;
  double spurious_pair_ratio = 0.0;
  double false_pair_ratio = 0.0;  // alias and spurious
  // Images of at least one false pair.
  int num_images_with_false_pairs = 0;
  // Of the true pairs.
  double rotation_outlier_ratio = 0.0;
  // Of the raw matches of true pairs.
  double outlier_match_ratio = 0.0;
  int num_gnss_fixes = 0;
  // Share of the photos after the first whose gain differs from that of the
  // previous one, and the largest factor between two successive photos.
  double exposure_jump_ratio = 0.0;
  double max_exposure_factor = 1.0;
  // Blur of a photo: mean distance by which its keypoints move while the
  // shutter is open. Mean and maximum over the photos, and the share of photos
  // above 2 px.
  double mean_blur_px = 0.0;
  double max_blur_px = 0.0;
  double blurred_photo_ratio = 0.0;
  double max_focal_error_percent = 0.0;
};

SyntheticWorldSummary SummarizeWorld(const SyntheticWorld& world);

// Names and values, in the order above; figures of exposure, blur and focal
// lengths only where the world has such effects.
std::vector<std::pair<std::string, double>> ListFigures(
    const SyntheticWorldSummary& summary);

}  // namespace adasfm
