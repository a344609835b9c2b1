// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>

#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// The registered images in the order of their ids.
inline std::set<image_t> RegisteredImages(
    const colmap::Reconstruction& reconstruction) {
  const auto& image_ids = reconstruction.RegImageIds();
  return std::set<image_t>(image_ids.begin(), image_ids.end());
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
