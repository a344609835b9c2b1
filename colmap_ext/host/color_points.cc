// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/color_points.h"

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/capture_output.h"

namespace adasfm {

Status ColorPoints(const std::string& image_path,
                   const std::string& output_path,
                   const std::string& log_path) {
  StatusOr<colmap::Reconstruction> model = ReadModel(output_path + "/0");
  if (!model.ok()) return model.status();
  {
    const CaptureOutput capture(log_path, "Could not read");
    model->ExtractColorsForAllImages(image_path);
  }
  return WriteModelFolder(output_path, {&*model});
}

}  // namespace adasfm
