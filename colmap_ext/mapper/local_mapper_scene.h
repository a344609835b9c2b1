// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <set>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/host_mapper.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// The coarse model's poses, cam_from_world.
using CoarsePoseMap = std::map<image_t, Rigid3d>;

// The data of one part's mapper: COLMAP's mapper with the part's images and the
// matches among them, and the reconstruction that it changes. The
// reconstruction contains those images and their cameras; none is registered at
// first.
struct MapperScene {
  const SceneData* data = nullptr;
  const CoarsePoseMap* coarse = nullptr;
  std::set<image_t> images;
  colmap::Reconstruction reconstruction;
  HostMapper mapper{&reconstruction};
  // Matched images and the number of their matches, strongest first, ties by
  // id.
  std::map<image_t, std::vector<std::pair<image_t, int>>> neighbors;
  // The members of data->priors and frame_priors within the part; and for each
  // image their indices.
  std::vector<RelativePosePrior> priors;
  std::map<image_t, std::vector<size_t>> priors_of_image;
};

// `data` and `coarse` must outlive the scene. Images unknown to `data` are left
// out. Without matches, which take the most memory, the mapper is as after
// HostMapper::ReleaseMatches.
std::unique_ptr<MapperScene> BuildMapperScene(const SceneData& data,
                                              const CoarsePoseMap& coarse,
                                              const std::set<image_t>& images,
                                              bool with_matches = true);

}  // namespace adasfm
