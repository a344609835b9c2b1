// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/world_summary.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "synthetic/photo_settings.h"

namespace adasfm {
namespace {

constexpr int kMinNumKeypoints = 15;
constexpr int kMaxSequenceGap = 10;
constexpr double kMaxSharpBlurPx = 2.0;

double Ratio(double part, double all) { return all > 0.0 ? part / all : 0.0; }

bool IsOnCar(const SyntheticImage& image, size_t keypoint) {
  return !image.car_point_ids.empty() && image.car_point_ids[keypoint] >= 0;
}

void CountImages(const SyntheticWorld& world, SyntheticWorldSummary* summary) {
  size_t num_keypoints = 0;
  size_t num_moving = 0;
  double sum_overlap = 0.0;
  int num_steps = 0;
  for (size_t i = 0; i < world.images.size(); ++i) {
    const SyntheticImage& image = world.images[i];
    if (image.keypoints.size() < kMinNumKeypoints) {
      ++summary->num_images_without_texture;
      continue;
    }
    num_keypoints += image.keypoints.size();
    for (size_t k = 0; k < image.keypoints.size(); ++k) {
      num_moving += IsOnCar(image, k);
    }
    if (i + 1 == world.images.size()) continue;
    const std::vector<int>& ids = image.landmark_ids;
    const std::set<int> next(world.images[i + 1].landmark_ids.begin(),
                             world.images[i + 1].landmark_ids.end());
    sum_overlap +=
        Ratio(std::count_if(ids.begin(), ids.end(),
                            [&next](int id) { return next.count(id) > 0; }),
              ids.size());
    ++num_steps;
  }
  summary->mean_num_keypoints = Ratio(
      num_keypoints, summary->num_images - summary->num_images_without_texture);
  summary->moving_keypoint_ratio = Ratio(num_moving, num_keypoints);
  summary->mean_overlap = Ratio(sum_overlap, num_steps);
}

void CountPairs(const SyntheticWorld& world, SyntheticWorldSummary* summary) {
  size_t num_alias = 0, num_spurious = 0, num_rotation_outliers = 0;
  size_t num_raw = 0, num_wrong = 0, num_inliers = 0, num_moving = 0;
  std::set<image_t> with_false_pairs;
  for (const SyntheticPair& pair : world.pairs) {
    num_alias += pair.is_alias;
    num_spurious += pair.is_spurious;
    if (pair.is_alias || pair.is_spurious) {
      with_false_pairs.insert({pair.image_id1, pair.image_id2});
      continue;
    }
    num_rotation_outliers += pair.is_rotation_outlier;
    summary->num_revisit_pairs +=
        pair.image_id2 - pair.image_id1 > kMaxSequenceGap;
    const SyntheticImage& image1 = world.images[pair.image_id1 - 1];
    const SyntheticImage& image2 = world.images[pair.image_id2 - 1];
    const auto point_of = [](const SyntheticImage& image, point2D_t k) {
      return IsOnCar(image, k) ? -1 - image.car_point_ids[k]
                               : image.landmark_ids[k];
    };
    for (const FeatureMatch& match : pair.raw_matches) {
      num_wrong += point_of(image1, match.point2D_idx1) !=
                   point_of(image2, match.point2D_idx2);
    }
    for (const FeatureMatch& match : pair.inlier_matches) {
      num_moving += IsOnCar(image1, match.point2D_idx1);
    }
    num_raw += pair.raw_matches.size();
    num_inliers += pair.inlier_matches.size();
  }
  const size_t num_pairs = world.pairs.size();
  const size_t num_false = num_alias + num_spurious;
  summary->num_pairs = static_cast<int>(num_pairs);
  summary->alias_pair_ratio = Ratio(num_alias, num_pairs);
  summary->spurious_pair_ratio = Ratio(num_spurious, num_pairs);
  summary->false_pair_ratio = Ratio(num_false, num_pairs);
  summary->num_images_with_false_pairs =
      static_cast<int>(with_false_pairs.size());
  summary->rotation_outlier_ratio =
      Ratio(num_rotation_outliers, num_pairs - num_false);
  summary->outlier_match_ratio = Ratio(num_wrong, num_raw);
  summary->moving_match_ratio = Ratio(num_moving, num_inliers);
}

void MeasurePhotos(const SyntheticWorld& world,
                   SyntheticWorldSummary* summary) {
  double sum_px = 0.0;
  int num_photos = 0, num_blurred = 0, num_steps = 0, num_jumps = 0;
  for (size_t i = 0; i < world.images.size(); ++i) {
    const SyntheticImage& image = world.images[i];
    summary->max_focal_error_percent =
        std::max(summary->max_focal_error_percent,
                 100.0 * std::abs(image.focal_factor - 1.0));
    if (i > 0 && image.camera_index == world.images[i - 1].camera_index) {
      const double step =
          image.exposure_gain / world.images[i - 1].exposure_gain;
      ++num_steps;
      num_jumps += step != 1.0;
      summary->max_exposure_factor =
          std::max({summary->max_exposure_factor, step, 1.0 / step});
    }
    const std::vector<double> lengths_px = ComputeBlurLengths(world, image);
    if (lengths_px.empty()) continue;
    const double blur_px =
        std::accumulate(lengths_px.begin(), lengths_px.end(), 0.0) /
        lengths_px.size();
    ++num_photos;
    num_blurred += blur_px > kMaxSharpBlurPx;
    sum_px += blur_px;
    summary->max_blur_px = std::max(summary->max_blur_px, blur_px);
  }
  summary->exposure_jump_ratio = Ratio(num_jumps, num_steps);
  summary->mean_blur_px = Ratio(sum_px, num_photos);
  summary->blurred_photo_ratio = Ratio(num_blurred, num_photos);
}

}  // namespace

SyntheticWorldSummary SummarizeWorld(const SyntheticWorld& world) {
  SyntheticWorldSummary summary;
  summary.num_images = static_cast<int>(world.images.size());
  for (size_t i = 1; i < world.images.size(); ++i) {
    summary.driven_m +=
        (world.images[i].cam_from_world.TargetOriginInSource() -
         world.images[i - 1].cam_from_world.TargetOriginInSource())
            .norm();
  }
  summary.duration_s = SecondsFromNs(world.images.back().timestamp_ns -
                                     world.images.front().timestamp_ns);
  for (const auto& [begin, end] : world.stops) {
    summary.standing_s += SecondsFromNs(end - begin);
  }
  summary.num_gnss_fixes = static_cast<int>(world.gnss_fixes.size());
  CountImages(world, &summary);
  CountPairs(world, &summary);
  MeasurePhotos(world, &summary);
  return summary;
}

std::vector<std::pair<std::string, double>> ListFigures(
    const SyntheticWorldSummary& s) {
  std::vector<std::pair<std::string, double>> figures = {
      {"num_images", s.num_images},
      {"driven_m", s.driven_m},
      {"duration_s", s.duration_s},
      {"standing_s", s.standing_s},
      {"num_images_without_texture", s.num_images_without_texture},
      {"mean_num_keypoints", s.mean_num_keypoints},
      {"mean_overlap", s.mean_overlap},
      {"moving_keypoint_ratio", s.moving_keypoint_ratio},
      {"moving_match_ratio", s.moving_match_ratio},
      {"num_pairs", s.num_pairs},
      {"num_revisit_pairs", s.num_revisit_pairs},
      {"alias_pair_ratio", s.alias_pair_ratio},
      {"spurious_pair_ratio", s.spurious_pair_ratio},
      {"false_pair_ratio", s.false_pair_ratio},
      {"num_images_with_false_pairs", s.num_images_with_false_pairs},
      {"rotation_outlier_ratio", s.rotation_outlier_ratio},
      {"outlier_match_ratio", s.outlier_match_ratio},
      {"num_gnss_fixes", s.num_gnss_fixes},
  };
  if (s.exposure_jump_ratio > 0.0) {
    figures.emplace_back("exposure_jump_ratio", s.exposure_jump_ratio);
    figures.emplace_back("max_exposure_factor", s.max_exposure_factor);
  }
  if (s.max_blur_px > 0.0) {
    figures.emplace_back("mean_blur_px", s.mean_blur_px);
    figures.emplace_back("max_blur_px", s.max_blur_px);
    figures.emplace_back("blurred_photo_ratio", s.blurred_photo_ratio);
  }
  if (s.max_focal_error_percent > 0.0) {
    figures.emplace_back("max_focal_error_percent", s.max_focal_error_percent);
  }
  return figures;
}

}  // namespace adasfm
