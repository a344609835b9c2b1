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

// Computes VLAD vectors over a vocabulary trained on the database's own local
// descriptors, and reduces them to 512 principal components; needs no download.
// Images without descriptors are skipped, with a warning. Memory: the training
// sample (50 MB) and 512 floats per image. An error when no image has
// descriptors. num_threads: -1: all of the machine; the result does not depend
// on it.
StatusOr<GlobalDescriptors> ComputeGlobalDescriptors(
    const std::string& database_path, int num_threads,
    const ProgressCallback& progress = {});

// Reads vectors of other programs (HFNet, NetVLAD, ...) from a text file with
// lines `image_name v1 v2 ... vn`, comments with #. Names that the database
// lacks give a warning, and so do images without a vector. Vectors are scaled
// to unit length. Errors name file, line and cause.
StatusOr<GlobalDescriptors> ReadGlobalDescriptors(
    const std::string& path, const std::string& database_path);

}  // namespace adasfm
