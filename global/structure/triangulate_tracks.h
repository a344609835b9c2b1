// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "core/bearing.h"
#include "core/rigid3d.h"
#include "global/view_graph/tracks.h"

namespace adasfm {

struct TrackTriangulationOptions {
  // Least value of the largest angle between two of a track's rays.
  double min_triangulation_angle_deg = 5.0;
  // Largest reprojection error; generous, the poses are coarse.
  double max_reproj_error_px = 16.0;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct TriangulatedTrack {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Track track;  // the observations that agree
  double mean_reproj_error_px = 0.0;
  double angle_deg = 0.0;
};

// Points of tracks under known poses: midpoint of the pair of rays that most
// others agree with, refined over all agreeing rays, at least
// kMinNumTrackImages. Errors are in px, through the bearings' Jacobians. Tracks
// that fail are left out; order is kept.
std::vector<TriangulatedTrack> TriangulateTracks(
    const TrackTriangulationOptions& options,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const std::vector<Track>& tracks);

}  // namespace adasfm
