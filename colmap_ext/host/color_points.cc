// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/color_points.h"

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/capture_output.h"

namespace adasfm {

Status ColorPoints(const std::string& image_path,
                   const std::string& output_path,
                   const std::string& log_path) {
  std::vector<colmap::Reconstruction> models;
  std::error_code error;
  for (int k = 0;
       std::filesystem::exists(output_path + "/" + std::to_string(k), error);
       ++k) {
    StatusOr<colmap::Reconstruction> model =
        ReadModel(output_path + "/" + std::to_string(k));
    if (!model.ok()) return model.status();
    models.push_back(std::move(*model));
  }
  std::vector<const colmap::Reconstruction*> pointers;
  for (colmap::Reconstruction& model : models) {
    const CaptureOutput capture(log_path, "Could not read");
    model.ExtractColorsForAllImages(image_path);
    pointers.push_back(&model);
  }
  return WriteModelFolder(output_path, pointers);
}

}  // namespace adasfm
