// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/bearing.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

struct MatchRefinementOptions {
  bool enabled = true;
  // eps_M: distances to the epipolar lines, summed over both views.
  double max_epipolar_error_px = 4.0;
  // Pairs with fewer matches left are removed.
  int min_num_matches = 15;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct RefinedPair {
  ImagePair pair;
  // Of the global poses; the translation has their unit.
  Rigid3d cam2_from_cam1;
  std::vector<FeatureMatch> matches;  // sorted
  // Median of the angles between the rays of a match.
  double median_parallax_rad = 0.0;
  int num_candidates = 0;
  bool removed = false;
};

struct MatchRefinementReport {
  std::vector<RefinedPair> pairs;  // in order of the pairs
  int num_removed_pairs = 0;
  int num_skipped_pairs = 0;  // an image without pose: not in pairs
  size_t num_candidates = 0;
  size_t num_kept = 0;
};

// Keeps those candidate matches of each pair (raw ones where there are, else
// its inliers) that agree with the global poses (step 2.8): the distances to
// the epipolar lines, measured in the image through the bearings' Jacobians
// (any camera model), sum to at most eps_M, and the point lies in front of both
// cameras. A keypoint that is matched twice keeps its best match.
MatchRefinementReport RefineMatches(
    const MatchRefinementOptions& options,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const std::map<ImagePair, std::vector<FeatureMatch>>& candidates);

// How many of the matches agree with one relative pose, as above.
int CountFittingMatches(double max_epipolar_error_px,
                        const Rigid3d& cam2_from_cam1,
                        const std::vector<Bearing>& bearings1,
                        const std::vector<Bearing>& bearings2,
                        const std::vector<FeatureMatch>& matches);

}  // namespace adasfm
