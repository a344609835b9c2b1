// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/mapper_stage/map_components.h"
#include "core/rigid3d.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// Coarse poses in the frame of an existing model: its images have their poses
// there, and each other image keeps its coarse motion to the nearest of them.
// Both maps must have two images in common, not at one place. scale: length
// there over the coarse length.
struct CoarsePosesAtExisting {
  CoarsePoseMap poses;
  double scale = 1.0;
};
CoarsePosesAtExisting MoveToExistingModel(
    const std::map<image_t, Rigid3d>& existing, const CoarsePoseMap& coarse);

// Sets SceneData::fixed_poses of the components by an existing model whose
// images have the names of the scene's, and moves their coarse poses and their
// cameras to it. `constant_cameras`: the cameras of such images are added. A
// component without two such images remains as it is. An error where no
// component has them, or where the sensors' metres are not the unit of the
// model.
Status UseExistingModel(const colmap::Reconstruction& existing,
                        std::vector<ComponentToMap>* components,
                        std::set<camera_t>* constant_cameras,
                        std::vector<std::string>* warnings);

}  // namespace adasfm
