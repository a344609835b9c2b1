// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/model_sights.h"

#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "global/structure/triangulate_tracks.h"

namespace adasfm {
namespace {

// Least angle between the rays of a point, for a depth known to 5 % or so.
constexpr double kMinAngleDeg = 2.0;
// Between two adjustments, points and poses differ by more than keypoints err.
constexpr double kMaxErrorFactor = 2.0;

using Sights = std::map<std::pair<int, TrackElement>, SightAcross>;

// Adds an observation of the point of `from` with keypoint `seen`, by the
// matched `keypoint` of the other model.
void AddSight(const ModelPoints& from, const TrackElement& seen,
              const ModelPoints& by, const TrackElement& keypoint,
              bool is_point_of_a, Sights* sights) {
  const auto point = from.point_of.find(seen);
  if (point == from.point_of.end()) return;
  const Rigid3d& pose = by.cams_from_world.at(keypoint.image_id);
  const Bearing& bearing =
      by.bearings.at(keypoint.image_id).at(keypoint.point2D_idx);
  SightAcross sight;
  sight.is_point_of_a = is_point_of_a;
  sight.point_id = is_point_of_a ? point->second : -1 - point->second;
  sight.point = from.points[point->second];
  sight.center = pose.TargetOriginInSource();
  sight.ray = pose.rotation.conjugate() * bearing.direction;
  sight.max_angle_rad =
      kMaxErrorFactor * kFinalMaxReprojErrorPx * bearing.jacobian.col(0).norm();
  sights->insert({{sight.point_id, keypoint}, sight});
}

}  // namespace

ModelPoints TriangulateModel(
    const CoarseStructureOptions& options, const CoarseModel& model,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches) {
  ModelPoints points;
  points.cams_from_world = CamsFromWorld(model.reconstruction);
  TrackTriangulationOptions triangulation = options.triangulation;
  triangulation.min_triangulation_angle_deg = kMinAngleDeg;
  triangulation.max_reproj_error_px = kFinalMaxReprojErrorPx;
  points.bearings =
      ComputeModelBearings(model.reconstruction, triangulation.num_threads);
  for (const TriangulatedTrack& track :
       TriangulateTracks(triangulation, points.cams_from_world, points.bearings,
                         BuildTracks(matches))) {
    for (const TrackElement& element : track.track) {
      points.point_of[element] = static_cast<int>(points.points.size());
    }
    points.points.push_back(track.point_in_world);
  }
  return points;
}

std::vector<SightAcross> FindSightsAcross(
    const ModelPoints& a, const ModelPoints& b,
    const std::vector<ImagePair>& pairs,
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches) {
  Sights sights;
  for (const ImagePair& pair : pairs) {
    for (const FeatureMatch& match : matches.at(pair)) {
      TrackElement of_a{pair.image_id1, match.point2D_idx1};
      TrackElement of_b{pair.image_id2, match.point2D_idx2};
      if (a.cams_from_world.count(pair.image_id1) == 0) std::swap(of_a, of_b);
      AddSight(a, of_a, b, of_b, true, &sights);
      AddSight(b, of_b, a, of_a, false, &sights);
    }
  }
  std::vector<SightAcross> list;
  for (const auto& [key, sight] : sights) list.push_back(sight);
  return list;
}

}  // namespace adasfm
