// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/two_view_poses.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/host/two_view.h"
#include "colmap_ext/scene/capture_order.h"
#include "core/parallel.h"
#include "global/view_graph/epipolar.h"

namespace adasfm {
namespace {

// Matches used to choose among the four decompositions and to test a pose.
constexpr int kMaxNumTestedMatches = 100;

// A stored pose or essential matrix is used when at least this share of the
// pair's matches agrees with it, within this epipolar distance [px]. Otherwise
// the pose is estimated anew from the matches.
constexpr double kMinAgreeingRatio = 0.6;
constexpr double kMaxErrorPx = 4.0;

enum class PoseOrigin { kNone, kStored, kDecomposed, kReestimated };

double InlierRatio(const Rigid3d& pose, const EdgeBearings& selected) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  int num_inliers = 0;
  for (size_t k = 0; k < selected.bearings1.size(); ++k) {
    const EpipolarResidual residual =
        ComputeEpipolarResidual(*selected.bearings1[k], *selected.bearings2[k],
                                rotation, pose.translation);
    if (std::abs(residual.distance_px) <= kMaxErrorPx) ++num_inliers;
  }
  return num_inliers / std::max<double>(1.0, selected.bearings1.size());
}

std::optional<Rigid3d> EstimateFromMatches(const SceneData& scene,
                                           const ScenePair& pair) {
  const SceneImage& image1 = scene.images.at(pair.image_id1);
  const SceneImage& image2 = scene.images.at(pair.image_id2);
  const colmap::Camera& camera1 = scene.cameras.at(image1.camera_id);
  const colmap::Camera& camera2 = scene.cameras.at(image2.camera_id);
  std::vector<Eigen::Vector2d> points1, points2;
  for (const FeatureMatch& match : pair.inlier_matches) {
    const Eigen::Vector2d point1 =
        PlaneFromPixel(camera1, image1.keypoints.at(match.point2D_idx1));
    const Eigen::Vector2d point2 =
        PlaneFromPixel(camera2, image2.keypoints.at(match.point2D_idx2));
    if (!point1.allFinite() || !point2.allFinite()) continue;
    points1.push_back(point1);
    points2.push_back(point2);
  }
  if (points1.size() < 8) return std::nullopt;
  const double max_error =
      0.5 * kMaxErrorPx *
      (1.0 / camera1.MeanFocalLength() + 1.0 / camera2.MeanFocalLength()) / 2.0;
  return EstimateRelativePose(points1, points2, max_error,
                              pair.image_id1 * 40503u + pair.image_id2);
}

PoseOrigin FindPose(const SceneData& scene,
                    const std::vector<Bearing>& bearings1,
                    const std::vector<Bearing>& bearings2,
                    const ScenePair& pair, Rigid3d* cam2_from_cam1) {
  if (!IsVerifiedConfiguration(pair.config)) return PoseOrigin::kNone;
  const EdgeBearings selected = SelectEdgeBearings(
      bearings1, bearings2, pair.inlier_matches, kMaxNumTestedMatches);
  const auto is_supported = [&] {
    return cam2_from_cam1->translation.allFinite() &&
           cam2_from_cam1->rotation.coeffs().allFinite() &&
           InlierRatio(*cam2_from_cam1, selected) >= kMinAgreeingRatio;
  };
  if (pair.cam2_from_cam1.has_value()) {
    *cam2_from_cam1 = *pair.cam2_from_cam1;
    if (is_supported()) return PoseOrigin::kStored;
  }
  if (pair.essential_matrix.has_value()) {
    *cam2_from_cam1 = DecomposeEssential(*pair.essential_matrix, bearings1,
                                         bearings2, pair.inlier_matches);
    if (is_supported()) return PoseOrigin::kDecomposed;
  }
  const std::optional<Rigid3d> estimated = EstimateFromMatches(scene, pair);
  if (!estimated.has_value()) return PoseOrigin::kNone;
  *cam2_from_cam1 = *estimated;
  return PoseOrigin::kReestimated;
}

}  // namespace

Rigid3d DecomposeEssential(const Eigen::Matrix3d& essential_matrix,
                           const std::vector<Bearing>& bearings1,
                           const std::vector<Bearing>& bearings2,
                           const std::vector<FeatureMatch>& matches) {
  const EssentialPoses poses = DecomposeEssentialMatrix(essential_matrix);
  const EdgeBearings selected =
      SelectEdgeBearings(bearings1, bearings2, matches, kMaxNumTestedMatches);
  int best_votes = -1;
  Rigid3d best;
  for (const Eigen::Matrix3d& rotation : poses.rotations) {
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector3d signed_translation = sign * poses.translation;
      int votes = 0;
      for (size_t k = 0; k < selected.bearings1.size(); ++k) {
        double depth1, depth2, sin_parallax;
        votes += ComputeRayDepths(selected.bearings1[k]->direction,
                                  selected.bearings2[k]->direction, rotation,
                                  signed_translation, &depth1, &depth2,
                                  &sin_parallax) &&
                 depth1 > 0.0 && depth2 > 0.0;
      }
      if (votes <= best_votes) continue;
      best_votes = votes;
      best = Rigid3d(rotation, signed_translation.normalized());
    }
  }
  return best;
}

InitialViewGraph BuildInitialViewGraph(
    const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings, int num_threads) {
  InitialViewGraph initial;
  std::vector<CapturedImage> captured;
  const std::map<uint32_t, image_t> leaders = FindFrameLeaders(scene.rigs);
  for (const auto& [image_id, image] : scene.images) {
    initial.graph.images.push_back(image_id);
    captured.push_back({image_id, image.name, image.timestamp_ns, image.drive});
    // Keeps the images of a frame adjacent when images are ordered by name.
    const auto rig_image = scene.rigs.images.find(image_id);
    if (rig_image == scene.rigs.images.end()) continue;
    const auto leader = leaders.find(rig_image->second.frame_id);
    if (leader == leaders.end()) continue;
    captured.back().name = scene.images.at(leader->second).name;
  }
  for (const auto& [image_id, rank] : RankByCapture(captured)) {
    // In the order of the ids.
    initial.graph.capture_ranks.push_back(rank.rank);
    initial.graph.capture_positions.push_back(rank.position);
  }
  std::vector<PoseOrigin> origins(scene.pairs.size(), PoseOrigin::kNone);
  std::vector<Rigid3d> poses(scene.pairs.size());
  ParallelFor(num_threads, scene.pairs.size(), [&](size_t i) {
    const ScenePair& pair = scene.pairs[i];
    origins[i] = FindPose(scene, bearings.at(pair.image_id1),
                          bearings.at(pair.image_id2), pair, &poses[i]);
  });
  for (size_t i = 0; i < scene.pairs.size(); ++i) {
    initial.num_without_pose += origins[i] == PoseOrigin::kNone;
    initial.num_stored_poses += origins[i] == PoseOrigin::kStored;
    initial.num_decomposed += origins[i] == PoseOrigin::kDecomposed;
    initial.num_reestimated += origins[i] == PoseOrigin::kReestimated;
    if (origins[i] == PoseOrigin::kNone) continue;
    ViewGraphEdge edge;
    edge.image_id1 = scene.pairs[i].image_id1;
    edge.image_id2 = scene.pairs[i].image_id2;
    edge.cam2_from_cam1 = poses[i];
    edge.num_inliers = static_cast<int>(scene.pairs[i].inlier_matches.size());
    initial.graph.edges.push_back(edge);
  }
  return initial;
}

}  // namespace adasfm
