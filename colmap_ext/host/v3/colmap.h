// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera.h>
#include <base/correspondence_graph.h>
#include <base/database.h>
#include <base/reconstruction.h>

#include "core/rigid3d.h"

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

}  // namespace adasfm
