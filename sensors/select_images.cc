// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/select_images.h"

#include <algorithm>
#include <tuple>

#include "sensors/io/format_figures.h"

namespace adasfm {

StatusOr<std::vector<ImageStamp>> OrderImages(std::vector<ImageStamp> images) {
  std::sort(images.begin(), images.end(),
            [](const ImageStamp& a, const ImageStamp& b) {
              return std::tie(a.timestamp_ns, a.image_id) <
                     std::tie(b.timestamp_ns, b.image_id);
            });
  for (size_t i = 1; i < images.size(); ++i) {
    if (images[i].timestamp_ns == images[i - 1].timestamp_ns) {
      return Status::Error("images '" + images[i - 1].name + "' and '" +
                           images[i].name +
                           "' have the same time; one camera is expected, or "
                           "cam1, cam2, ... in the calibration for the others "
                           "of a rig");
    }
  }
  return images;
}

StatusOr<std::vector<ImageStamp>> SelectImages(
    const std::vector<ImageStamp>& images, timestamp_t timeshift_ns,
    timestamp_t start_ns, timestamp_t end_ns) {
  std::vector<ImageStamp> selected;
  for (const ImageStamp& image : images) {
    const timestamp_t time = image.timestamp_ns + timeshift_ns;
    if (time >= start_ns && time <= end_ns) selected.push_back(image);
  }
  if (!selected.empty()) return selected;
  return Status::Error(
      FormatFigures("no image lies within the sensor logs: images run from "
                    "%.3f to %.3f s, ",
                    SecondsFromNs(images.front().timestamp_ns),
                    SecondsFromNs(images.back().timestamp_ns)) +
      FormatFigures("logs from %.3f to %.3f s; check the clocks (units, epoch, "
                    "timeshift_cam_imu)",
                    SecondsFromNs(start_ns), SecondsFromNs(end_ns)));
}

}  // namespace adasfm
