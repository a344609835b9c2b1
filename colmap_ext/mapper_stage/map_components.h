// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// A component of the scene, with the coarse model that it is mapped from.
struct ComponentToMap {
  // Number of the model in adasfm_global's folder.
  int coarse_index = 0;
  // In the frame of the data's positions, if there are any.
  CoarsePoseMap coarse;
  SceneData data;
  // For RefineModelOptions; larger where the coarse model is deformed.
  std::optional<double> initial_position_loss_scale = std::nullopt;
};

struct MappedComponent {
  // Index among the components to map.
  size_t component = 0;
  MapperStageSummary summary;
  // Empty when no image could be reconstructed.
  colmap::Reconstruction model;
};

// Where the checkpoints of the k-th component are: output_path for k = 0, else
// output_path/component_<k>.
std::string ComponentOutputPath(const std::string& output_path, size_t k);

// Runs the mapper stage's steps on all components from index `first` on, one
// after another. The steps plan and part return no models; parts are numbered
// through all these components.
StatusOr<std::vector<MappedComponent>> MapComponents(
    const MapperStageOptions& options,
    const std::vector<ComponentToMap>& components, size_t first,
    const std::string& output_path, MapperSteps steps, int part_index,
    const MapperProgress& progress);

// Before any work: an error when foreign files are where checkpoints go.
Status CheckComponentCheckpoints(const std::string& output_path);

// Removes the checkpoints of components beyond the first num_components.
Status RemoveSurplusCheckpoints(const std::string& output_path,
                                size_t num_components);

}  // namespace adasfm
