// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/scene_data.h"

namespace adasfm {

// Distorts keypoints by two radial terms. The database has one radial term of
// zero instead, and this multiple of the camera's focal length.
inline void UseUnknownLens(double k1, double k2, double given_ratio,
                           SceneData* scene, camera_t camera_id = 1) {
  colmap::Camera& camera = scene->cameras.at(camera_id);
  const double focal_px = camera.MeanFocalLength();
  const Eigen::Vector2d center(camera.PrincipalPointX(),
                               camera.PrincipalPointY());
  camera.SetModelIdFromName("SIMPLE_RADIAL");
  camera.SetParams({given_ratio * focal_px, center.x(), center.y(), 0.0});
  camera.SetPriorFocalLength(false);
  for (auto& [image_id, image] : scene->images) {
    if (image.camera_id != camera_id) continue;
    for (Eigen::Vector2d& keypoint : image.keypoints) {
      const Eigen::Vector2d ray = (keypoint - center) / focal_px;
      const double r2 = ray.squaredNorm();
      keypoint = center + focal_px * (1.0 + k1 * r2 + k2 * r2 * r2) * ray;
    }
  }
}

}  // namespace adasfm
