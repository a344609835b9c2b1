// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/pairs/vlad.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// One vector an image; near vectors are similar places.
struct GlobalDescriptors {
  std::vector<image_t> image_ids;
  RowMatrixXf vectors;  // one row an image
  std::vector<std::string> warnings;
};

struct GlobalDescriptorOptions {
  VocabularyOptions vocabulary;
  // The vocabulary is trained on so many local descriptors, drawn from all
  // images alike; bounds the memory at 512 bytes each.
  int max_num_training_descriptors = 100000;
  // VLAD vectors are reduced to so many principal components, which are learned
  // from max_num_pca_images of them; 0 keeps them whole.
  int num_dimensions = 512;
  int max_num_pca_images = 1000;
  // -1: all of the machine's.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// VLAD over a vocabulary trained on the database's own local descriptors; no
// download. Images without descriptors are left out, with a warning. Memory:
// the training sample and num_dimensions floats an image. An error when there
// is nothing to train on. The result does not depend on the threads.
StatusOr<GlobalDescriptors> ComputeGlobalDescriptors(
    const GlobalDescriptorOptions& options, const std::string& database_path,
    const ProgressCallback& progress = {});

// Vectors from elsewhere (HFNet, NetVLAD, ...): a text file with lines
// `image_name v1 v2 ... vn`, comments with #. Names are the database's; names
// that it does not have are a warning, as are images without a vector. Vectors
// are scaled to unit length. Errors name file, line and cause.
StatusOr<GlobalDescriptors> ReadGlobalDescriptors(
    const std::string& path, const std::string& database_path);

}  // namespace adasfm
