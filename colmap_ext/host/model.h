// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/status.h"

namespace adasfm {

// The model folders at a path: the path itself when it is a model, else those
// of its subfolders that are models, sorted by name.
std::vector<std::string> FindModels(const std::string& path);

// An error when the file, one of cameras.bin, images.bin and points3D.bin, does
// not consist of exactly as many complete records as it declares.
Status CheckBinaryModelFile(const std::string& path);

// Reads a binary or text model. An error for files that are missing, cut short
// or otherwise malformed, where COLMAP's own reader would end the process or
// never return.
StatusOr<colmap::Reconstruction> ReadModel(const std::string& path);

struct LargestModel {
  colmap::Reconstruction reconstruction;
  std::string folder;
};

// The model with the most images; the first one of several. `folders` must not
// be empty.
StatusOr<LargestModel> ReadLargestModel(
    const std::vector<std::string>& folders);

}  // namespace adasfm
