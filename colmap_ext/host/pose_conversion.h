// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/reconstruction.h>

#include <map>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// COLMAP's pose of an image (w x y z, translation) as ours, and back.
inline Rigid3d CamFromWorld(const colmap::Image& image) {
  const Eigen::Vector4d& qvec = image.Qvec();
  return Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)),
                 image.Tvec());
}

inline void SetCamFromWorld(const Rigid3d& cam_from_world,
                            colmap::Image* image) {
  const Eigen::Quaterniond& rotation = cam_from_world.rotation;
  image->SetQvec(
      Eigen::Vector4d(rotation.w(), rotation.x(), rotation.y(), rotation.z()));
  image->SetTvec(cam_from_world.translation);
}

// The poses of all registered images.
inline std::map<image_t, Rigid3d> CamsFromWorld(
    const colmap::Reconstruction& reconstruction) {
  std::map<image_t, Rigid3d> poses;
  for (const image_t image_id : reconstruction.RegImageIds()) {
    poses[image_id] = CamFromWorld(reconstruction.Image(image_id));
  }
  return poses;
}

}  // namespace adasfm
