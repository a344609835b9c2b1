// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/pair_options.h"

#include <string>

namespace adasfm {

void AddPairOptions(PairSelectionOptions* options, CommandOptions* command) {
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmPairs." + name, value, help);
  };
  GlobalDescriptorOptions* descriptors = &options->descriptors;
  add("num_temporal_neighbors", &options->num_temporal_neighbors,
      "every image is matched with so many of the next ones in time");
  add("num_similar_images", &options->num_similar_images,
      "and with so many of the most similar ones beyond them");
  add("use_odometry", &options->odometry.enabled,
      "these are chosen by the overlap of views that the priors in the "
      "database predict, and by similarity only where they cannot tell");
  add("scene_depth_m", &options->odometry.scene_depth_m,
      "how far away what the photos show typically is [m]");
  add("min_overlap", &options->odometry.min_overlap,
      "share of the views, below which predicted pairs are left out");
  add("descriptors_path", &options->descriptors_path,
      "global descriptors from elsewhere, lines `image_name v1 v2 ... vn`; "
      "when "
      "empty, they are made from the database's features");
  add("num_words", &descriptors->vocabulary.num_words,
      "words of the vocabulary");
  add("max_num_iterations", &descriptors->vocabulary.max_num_iterations,
      "iterations of k-means");
  add("seed", &descriptors->vocabulary.seed,
      "equal seeds give equal vocabularies");
  add("max_num_training_descriptors",
      &descriptors->max_num_training_descriptors,
      "features that the vocabulary is trained on");
  add("num_dimensions", &descriptors->num_dimensions,
      "principal components that a global descriptor is reduced to; 0 keeps it "
      "whole");
  add("max_num_pca_images", &descriptors->max_num_pca_images,
      "images that the principal components are learned from");
}

}  // namespace adasfm
