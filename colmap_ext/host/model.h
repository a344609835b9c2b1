// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/status.h"

namespace adasfm {

// The model folders at a path: the path itself when it holds a model, else
// those of its subfolders that do, sorted by name.
std::vector<std::string> FindModels(const std::string& path);

// An error when the file, one of cameras.bin, images.bin and points3D.bin, does
// not consist of as many records as it says, each of them whole.
Status CheckBinaryModelFile(const std::string& path);

// Reads a binary or text model. Files that are missing, cut short or otherwise
// malformed are an error; COLMAP's own reader would end the process, or never
// return.
StatusOr<colmap::Reconstruction> ReadModel(const std::string& path);

struct LargestModel {
  colmap::Reconstruction reconstruction;
  std::string folder;
};

// The one of most images, the first of several; there is a folder.
StatusOr<LargestModel> ReadLargestModel(
    const std::vector<std::string>& folders);

}  // namespace adasfm
