// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/align_to_gravity.h"

#include <algorithm>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {

std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const colmap::Reconstruction& reconstruction) {
  return FindGravityInWorld(scene, CamsFromWorld(reconstruction));
}

std::optional<Eigen::Vector3d> FindGravityInWorld(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world) {
  std::vector<Eigen::Vector3d> directions;
  for (const auto& [image_id, pose] : cams_from_world) {
    const auto image = scene.images.find(image_id);
    if (image == scene.images.end() || !image->second.gravity_in_cam) continue;
    directions.push_back(pose.rotation.conjugate() *
                         image->second.gravity_in_cam->normalized());
  }
  if (directions.empty()) return std::nullopt;
  Eigen::Vector3d median = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& direction : directions) median += direction;
  // Weiszfeld.
  for (int iteration = 0; iteration < 20; ++iteration) {
    if (!(median.norm() > 1e-9)) return std::nullopt;
    median.normalize();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& direction : directions) {
      sum += direction / std::max(1e-6, (direction - median).norm());
    }
    median = sum;
  }
  return median.normalized();
}

void TransformReconstruction(const Sim3d& new_from_old,
                             colmap::Reconstruction* reconstruction) {
  for (const auto& [image_id, pose] : CamsFromWorld(*reconstruction)) {
    SetCamFromWorld(TransformCamFromWorld(new_from_old, pose),
                    &reconstruction->Image(image_id));
  }
  for (const colmap::point3D_t point_id : reconstruction->Point3DIds()) {
    colmap::Point3D& point = reconstruction->Point3D(point_id);
    SetXyz(new_from_old * XyzOf(point), &point);
  }
}

bool AlignToGravity(const SceneData& scene,
                    colmap::Reconstruction* reconstruction) {
  const std::optional<Eigen::Vector3d> gravity =
      FindGravityInWorld(scene, *reconstruction);
  if (!gravity) return false;
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(*reconstruction);
  const Eigen::Quaterniond level_from_world =
      Eigen::Quaterniond::FromTwoVectors(*gravity, -Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d origin = poses.begin()->second.TargetOriginInSource();
  const Sim3d new_from_old(1.0, level_from_world, level_from_world * -origin);
  TransformReconstruction(new_from_old, reconstruction);
  return true;
}

}  // namespace adasfm
