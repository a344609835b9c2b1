// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/match_refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "core/median.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/so3.h"
#include "global/view_graph/epipolar.h"

namespace adasfm {
namespace {

// d(u, E^T u') + d(u', E u) in px (paper, eq. 4), each measured in its own
// image: |x2^T E x1| / |J^T n| with the line's normal n. Infinite behind a
// camera.
double EpipolarError(const Bearing& bearing1, const Bearing& bearing2,
                     const Eigen::Matrix3d& rotation,
                     const Eigen::Vector3d& translation) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d n2 = translation.cross(rotation * bearing1.direction);
  const Eigen::Vector3d n1 =
      rotation.transpose() * bearing2.direction.cross(translation);
  const double error = std::abs(bearing2.direction.dot(n2));
  const double norm1 = (bearing1.jacobian.transpose() * n1).norm();
  const double norm2 = (bearing2.jacobian.transpose() * n2).norm();
  // All epipolar lines pass through the epipole: distance zero.
  const double sum = (norm1 > 1e-15 ? error / norm1 : 0.0) +
                     (norm2 > 1e-15 ? error / norm2 : 0.0);
  double depth1, depth2, sin_parallax;
  if (ComputeRayDepths(bearing1.direction, bearing2.direction, rotation,
                       translation, &depth1, &depth2, &sin_parallax)) {
    // Below a parallax of two pixels, a pixel of noise can change the depth's
    // sign.
    const double pixel_rad =
        std::max(bearing1.jacobian.norm(), bearing2.jacobian.norm());
    const bool is_certain = sin_parallax > 2.0 * pixel_rad;
    if (is_certain && (depth1 <= 0.0 || depth2 <= 0.0)) return kInfinity;
  }
  return sum;
}

// Matches that agree, with their errors [px]; none without a baseline, since
// there are no epipolar lines. The errors do not depend on the baseline's
// length.
std::vector<std::pair<double, FeatureMatch>> FindFittingMatches(
    double max_epipolar_error_px, const Rigid3d& cam2_from_cam1,
    const std::vector<Bearing>& bearings1,
    const std::vector<Bearing>& bearings2,
    const std::vector<FeatureMatch>& matches) {
  std::vector<std::pair<double, FeatureMatch>> fitting;
  const double baseline = cam2_from_cam1.translation.norm();
  if (!(baseline > 0.0)) return fitting;
  const Eigen::Matrix3d rotation = cam2_from_cam1.rotation.toRotationMatrix();
  const Eigen::Vector3d translation = cam2_from_cam1.translation / baseline;
  for (const FeatureMatch& match : matches) {
    const double error_px =
        EpipolarError(bearings1.at(match.point2D_idx1),
                      bearings2.at(match.point2D_idx2), rotation, translation);
    if (error_px <= max_epipolar_error_px) {
      fitting.emplace_back(error_px, match);
    }
  }
  return fitting;
}

// Each keypoint's best match; ties by index.
std::vector<FeatureMatch> KeepBestPerKeypoint(
    std::vector<std::pair<double, FeatureMatch>> scored) {
  std::sort(scored.begin(), scored.end());
  std::set<point2D_t> used1;
  std::set<point2D_t> used2;
  std::vector<FeatureMatch> kept;
  for (const auto& [error_px, match] : scored) {
    if (used1.count(match.point2D_idx1) || used2.count(match.point2D_idx2)) {
      continue;
    }
    used1.insert(match.point2D_idx1);
    used2.insert(match.point2D_idx2);
    kept.push_back(match);
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

double MedianParallax(const Eigen::Quaterniond& cam2_from_cam1,
                      const std::vector<Bearing>& bearings1,
                      const std::vector<Bearing>& bearings2,
                      const std::vector<FeatureMatch>& matches) {
  const Eigen::Matrix3d rotation = cam2_from_cam1.toRotationMatrix();
  std::vector<double> angles;
  angles.reserve(matches.size());
  for (const FeatureMatch& match : matches) {
    angles.push_back(
        AngleBetweenRad(rotation * bearings1.at(match.point2D_idx1).direction,
                        bearings2.at(match.point2D_idx2).direction));
  }
  return UpperMedian(&angles);
}

void RefinePair(const MatchRefinementOptions& options,
                const std::vector<Bearing>& bearings1,
                const std::vector<Bearing>& bearings2,
                const std::vector<FeatureMatch>& candidates,
                RefinedPair* pair) {
  pair->num_candidates = candidates.size();
  if (!options.enabled) {
    pair->matches = candidates;
    std::sort(pair->matches.begin(), pair->matches.end());
    return;
  }
  pair->matches = KeepBestPerKeypoint(
      FindFittingMatches(options.max_epipolar_error_px, pair->cam2_from_cam1,
                         bearings1, bearings2, candidates));
  pair->removed =
      static_cast<int>(pair->matches.size()) < options.min_num_matches;
  pair->median_parallax_rad = MedianParallax(
      pair->cam2_from_cam1.rotation, bearings1, bearings2, pair->matches);
}

}  // namespace

bool MatchRefinementOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmGlobal", error)
      .Positive("max_epipolar_error_px", max_epipolar_error_px)
      .AtLeast(0, "min_num_matches", min_num_matches)
      .AllHold();
}

int CountFittingMatches(double max_epipolar_error_px,
                        const Rigid3d& cam2_from_cam1,
                        const std::vector<Bearing>& bearings1,
                        const std::vector<Bearing>& bearings2,
                        const std::vector<FeatureMatch>& matches) {
  return static_cast<int>(FindFittingMatches(max_epipolar_error_px,
                                             cam2_from_cam1, bearings1,
                                             bearings2, matches)
                              .size());
}

MatchRefinementReport RefineMatches(
    const MatchRefinementOptions& options,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const std::map<ImagePair, std::vector<FeatureMatch>>& candidates) {
  MatchRefinementReport report;
  std::vector<const std::vector<FeatureMatch>*> pair_candidates;
  for (const auto& [pair, matches] : candidates) {
    const auto pose1 = cams_from_world.find(pair.image_id1);
    const auto pose2 = cams_from_world.find(pair.image_id2);
    if (pose1 == cams_from_world.end() || pose2 == cams_from_world.end()) {
      ++report.num_skipped_pairs;
      continue;
    }
    RefinedPair refined;
    refined.pair = pair;
    refined.cam2_from_cam1 = ComputeCam2FromCam1(pose1->second, pose2->second);
    report.pairs.push_back(std::move(refined));
    pair_candidates.push_back(&matches);
  }
  ParallelFor(options.num_threads, report.pairs.size(), [&](size_t k) {
    RefinedPair& pair = report.pairs[k];
    RefinePair(options, bearings.at(pair.pair.image_id1),
               bearings.at(pair.pair.image_id2), *pair_candidates[k], &pair);
  });
  for (const RefinedPair& pair : report.pairs) {
    report.num_candidates += pair.num_candidates;
    if (pair.removed) {
      ++report.num_removed_pairs;
    } else {
      report.num_kept += pair.matches.size();
    }
  }
  return report;
}

}  // namespace adasfm
