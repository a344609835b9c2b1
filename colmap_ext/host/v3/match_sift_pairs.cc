// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/v3/match_sift_pairs.h"

#include <feature/utils.h>
#include <util/random.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>

#include "colmap_ext/host/v3/verify_prediction.h"
#include "colmap_ext/matching/match_descriptors.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// COLMAP's defaults are in the options of its matcher.
colmap::TwoViewGeometry::Options VerificationOptions(size_t num_matches) {
  const colmap::SiftMatchingOptions sift;
  colmap::TwoViewGeometry::Options options;
  options.min_num_inliers = sift.min_num_inliers;
  colmap::RANSACOptions& ransac = options.ransac_options;
  ransac.max_error = sift.max_error;
  ransac.confidence = sift.confidence;
  ransac.min_num_trials = sift.min_num_trials;
  ransac.max_num_trials = sift.max_num_trials;
  // A geometry with a smaller inlier ratio has too few inliers to be accepted.
  // Without this bound, searching for such geometries would take most of the
  // time of pairs that show different places.
  ransac.min_inlier_ratio =
      std::max(sift.min_inlier_ratio,
               static_cast<double>(sift.min_num_inliers) / num_matches);
  return options;
}

DescriptorMatchingOptions MatchingOptions() {
  const colmap::SiftMatchingOptions sift;
  DescriptorMatchingOptions options;
  options.max_ratio = sift.max_ratio;
  options.max_distance_rad = sift.max_distance;
  return options;
}

PlaneKeypoints KeypointsOnPlane(const colmap::Camera& camera,
                                const colmap::FeatureKeypoints& keypoints) {
  PlaneKeypoints plane;
  plane.pixel_size = camera.ImageToWorldThreshold(1.0);
  plane.points.reserve(keypoints.size());
  for (const colmap::FeatureKeypoint& keypoint : keypoints) {
    plane.points.push_back(
        camera.ImageToWorld(Eigen::Vector2d(keypoint.x, keypoint.y)));
  }
  return plane;
}

// Whether the prediction's matches confirm matches that are found without it:
// an even sample of image 1's descriptors is compared with all of image 2. A
// wrong prediction finds only matches that happen to agree with it.
bool IsConfirmedByAll(const colmap::FeatureMatches& inlier_matches,
                      const colmap::FeatureDescriptors& descriptors1,
                      const colmap::FeatureDescriptors& descriptors2) {
  constexpr int kMaxSampleSize = 512;
  constexpr size_t kMinNumMatches = 8;
  constexpr double kMinShare = 0.4;
  const int num_all = descriptors1.rows();
  const int count = std::min(num_all, kMaxSampleSize);
  colmap::FeatureDescriptors sample(count, kSiftDimensions);
  for (int k = 0; k < count; ++k) {
    sample.row(k) = descriptors1.row(k * num_all / count);
  }
  const std::vector<FeatureMatch> matches =
      MatchDescriptors(MatchingOptions(), sample.data(), count,
                       descriptors2.data(), descriptors2.rows());
  std::map<point2D_t, point2D_t> partners;
  for (const colmap::FeatureMatch& match : inlier_matches) {
    partners[match.point2D_idx1] = match.point2D_idx2;
  }
  size_t num_agreeing = 0;
  for (const FeatureMatch& match : matches) {
    const auto partner = partners.find(match.point2D_idx1 * num_all / count);
    num_agreeing +=
        partner != partners.end() && partner->second == match.point2D_idx2;
  }
  return matches.size() >= kMinNumMatches &&
         num_agreeing >= kMinShare * matches.size();
}

colmap::FeatureMatches ForHost(const std::vector<FeatureMatch>& matches) {
  colmap::FeatureMatches host_matches;
  for (const FeatureMatch& match : matches) {
    host_matches.emplace_back(match.point2D_idx1, match.point2D_idx2);
  }
  return host_matches;
}

}  // namespace

std::optional<SiftPairMatcher::Result> SiftPairMatcher::MatchByPrediction(
    const ImagePair& pair) {
  if (!predictor_) return std::nullopt;
  const auto& camera1 =
      cache_->GetCamera(cache_->GetImage(pair.image_id1).CameraId());
  const auto& camera2 =
      cache_->GetCamera(cache_->GetImage(pair.image_id2).CameraId());
  if (!camera1.HasPriorFocalLength() || !camera2.HasPriorFocalLength()) {
    return std::nullopt;
  }
  const std::optional<PredictedMotion> prediction = predictor_(pair);
  if (!prediction) return std::nullopt;
  const auto keypoints1 = cache_->GetKeypoints(pair.image_id1);
  const auto keypoints2 = cache_->GetKeypoints(pair.image_id2);
  const PlaneKeypoints plane1 = KeypointsOnPlane(camera1, *keypoints1);
  const PlaneKeypoints plane2 = KeypointsOnPlane(camera2, *keypoints2);
  MatchCandidates candidates;
  if (!FindCandidates(*prediction, plane1, plane2, &candidates)) {
    return std::nullopt;
  }
  const auto descriptors1 = cache_->GetDescriptors(pair.image_id1);
  const auto descriptors2 = cache_->GetDescriptors(pair.image_id2);
  Result result;
  result.matches = ForHost(MatchCandidateDescriptors(
      MatchingOptions(), descriptors1->data(), descriptors1->rows(),
      descriptors2->data(), descriptors2->rows(), candidates));
  MatchedPoints points;
  for (const colmap::FeatureMatch& match : result.matches) {
    const colmap::FeatureKeypoint& keypoint1 =
        (*keypoints1)[match.point2D_idx1];
    const colmap::FeatureKeypoint& keypoint2 =
        (*keypoints2)[match.point2D_idx2];
    points.pixels1.emplace_back(keypoint1.x, keypoint1.y);
    points.pixels2.emplace_back(keypoint2.x, keypoint2.y);
    points.points1.push_back(plane1.points[match.point2D_idx1]);
    points.points2.push_back(plane2.points[match.point2D_idx2]);
  }
  colmap::SetPRNGSeed();
  const std::optional<colmap::TwoViewGeometry> geometry =
      VerifyPrediction(VerificationOptions(result.matches.size()), *prediction,
                       camera1, camera2, result.matches, points);
  if (!geometry || !IsConfirmedByAll(geometry->inlier_matches, *descriptors1,
                                     *descriptors2)) {
    return std::nullopt;
  }
  result.geometry = *geometry;
  result.is_guided = true;
  return result;
}

void SiftPairMatcher::Verify(const ImagePair& pair, Result* result) {
  const auto& camera1 =
      cache_->GetCamera(cache_->GetImage(pair.image_id1).CameraId());
  const auto& camera2 =
      cache_->GetCamera(cache_->GetImage(pair.image_id2).CameraId());
  const auto points1 = colmap::FeatureKeypointsToPointsVector(
      *cache_->GetKeypoints(pair.image_id1));
  const auto points2 = colmap::FeatureKeypointsToPointsVector(
      *cache_->GetKeypoints(pair.image_id2));
  // The seed belongs to the calling thread.
  colmap::SetPRNGSeed();
  result->geometry.Estimate(camera1, points1, camera2, points2, result->matches,
                            VerificationOptions(result->matches.size()));
}

SiftPairMatcher::Result SiftPairMatcher::MatchPair(const ImagePair& pair) {
  const auto descriptors1 = cache_->GetDescriptors(pair.image_id1);
  const auto descriptors2 = cache_->GetDescriptors(pair.image_id2);
  for (const auto& descriptors : {descriptors1, descriptors2}) {
    if (descriptors->rows() > 0 && descriptors->cols() != kSiftDimensions) {
      throw std::runtime_error("descriptors of " +
                               std::to_string(descriptors->cols()) +
                               " bytes are not SIFT's; use --matcher host");
    }
  }
  if (const std::optional<Result> guided = MatchByPrediction(pair)) {
    return *guided;
  }
  const size_t min_num_matches = colmap::SiftMatchingOptions().min_num_inliers;
  Result result;
  result.matches = ForHost(MatchDescriptors(
      MatchingOptions(), descriptors1->data(), descriptors1->rows(),
      descriptors2->data(), descriptors2->rows()));
  // COLMAP writes neither matches nor a geometry for fewer.
  if (result.matches.size() < min_num_matches) return Result();
  Verify(pair, &result);
  if (result.geometry.inlier_matches.size() < min_num_matches) {
    result.geometry = colmap::TwoViewGeometry();
  }
  return result;
}

void SiftPairMatcher::Match(const std::vector<ImagePair>& pairs) {
  std::vector<ImagePair> missing;
  for (const ImagePair& pair : pairs) {
    const bool has_matches =
        cache_->ExistsMatches(pair.image_id1, pair.image_id2);
    const bool has_geometry =
        cache_->ExistsInlierMatches(pair.image_id1, pair.image_id2);
    if (has_matches && has_geometry) continue;
    if (has_matches) cache_->DeleteMatches(pair.image_id1, pair.image_id2);
    if (has_geometry) {
      cache_->DeleteInlierMatches(pair.image_id1, pair.image_id2);
    }
    missing.push_back(pair);
  }
  std::vector<Result> results(missing.size());
  ParallelFor(num_threads_, missing.size(),
              [&](size_t i) { results[i] = MatchPair(missing[i]); });
  // This thread matched some of the pairs and so changed its random state; the
  // code that follows must not depend on this.
  colmap::SetPRNGSeed();
  for (size_t i = 0; i < missing.size(); ++i) {
    const auto& [image_id1, image_id2] = missing[i];
    num_guided_ += results[i].is_guided;
    cache_->WriteMatches(image_id1, image_id2, results[i].matches);
    cache_->WriteTwoViewGeometry(image_id1, image_id2, results[i].geometry);
  }
}

}  // namespace adasfm
