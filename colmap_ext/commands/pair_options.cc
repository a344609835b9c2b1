// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/pair_options.h"

#include <string>

namespace adasfm {

void AddPairOptions(PairSelectionOptions* options, CommandOptions* command) {
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmPairs." + name, value, help);
  };
  add("num_temporal_neighbors", &options->num_temporal_neighbors,
      "number of next images in time to match each image with");
  add("num_similar_images", &options->num_similar_images,
      "number of further images (overlapping or similar) to match each image "
      "with");
  add("use_odometry", &options->odometry.enabled,
      "select further images by the view overlap that the priors in the "
      "database predict, by similarity only where this is uncertain");
  add("scene_depth_m", &options->odometry.scene_depth_m,
      "typical distance of the scene from the camera [m]");
  add("min_overlap", &options->odometry.min_overlap,
      "smallest predicted overlap of a selected pair, as a share of the view");
  add("descriptors_path", &options->descriptors_path,
      "file of external global descriptors, lines `image_name v1 v2 ... vn`; "
      "when empty, computed from the features in the database");
}

}  // namespace adasfm
