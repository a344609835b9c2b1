// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/color_points.h"

#include <filesystem>
#include <string>

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/capture_output.h"

namespace adasfm {

Status ColorPoints(const std::string& image_path,
                   const std::string& output_path,
                   const std::string& log_path) {
  for (int k = 0;; ++k) {
    const std::string path = output_path + "/" + std::to_string(k);
    std::error_code error;
    if (!std::filesystem::exists(path, error)) return Status::Ok();
    StatusOr<colmap::Reconstruction> model = ReadModel(path);
    if (!model.ok()) return model.status();
    {
      const CaptureOutput capture(log_path, "Could not read");
      model->ExtractColorsForAllImages(image_path);
    }
    const Status status = ReplacePoints(*model, path);
    if (!status.ok()) return status;
  }
}

}  // namespace adasfm
