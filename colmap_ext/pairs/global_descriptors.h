// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/pairs/vlad.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// One vector per image; similar places have near vectors.
struct GlobalDescriptors {
  std::vector<image_t> image_ids;
  RowMatrixXf vectors;  // one row per image
  std::vector<std::string> warnings;
};

struct GlobalDescriptorOptions {
  VocabularyOptions vocabulary;
  // Number of local descriptors that the vocabulary is trained on, drawn
  // equally from all images; bounds the memory at 512 bytes each.
  int max_num_training_descriptors = 100000;
  // VLAD vectors are reduced to this many principal components, which are
  // learned from max_num_pca_images vectors; 0: no reduction.
  int num_dimensions = 512;
  int max_num_pca_images = 1000;
  // -1: all threads of the machine.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// Computes VLAD vectors over a vocabulary trained on the database's own local
// descriptors; needs no download. Images without descriptors are skipped, with
// a warning. Memory: the training sample and num_dimensions floats per image.
// An error when no image has descriptors. The result does not depend on the
// threads.
StatusOr<GlobalDescriptors> ComputeGlobalDescriptors(
    const GlobalDescriptorOptions& options, const std::string& database_path,
    const ProgressCallback& progress = {});

// Reads vectors of other programs (HFNet, NetVLAD, ...) from a text file with
// lines `image_name v1 v2 ... vn`, comments with #. Names that the database
// lacks give a warning, and so do images without a vector. Vectors are scaled
// to unit length. Errors name file, line and cause.
StatusOr<GlobalDescriptors> ReadGlobalDescriptors(
    const std::string& path, const std::string& database_path);

}  // namespace adasfm
