// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/bags/extract_bag.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

struct VideoExtractionOptions {
  PhotoSelectionOptions photos;
  // The video's time 0 on the clock of the logs [ns].
  timestamp_t start_ns = 0;
  // The wheel log for photos.image_distance_m; empty: none.
  std::string wheel_path;
};

// A frame of a video.
struct VideoFrame {
  timestamp_t time_ns = 0;
  // Width of the edges from ffmpeg's blurdetect [px]; infinity without edges.
  double blur_px = 0.0;
};

// For each time in `starts`, the index of the sharpest frame from this time to
// half way to the next one, so that the selected frames stay apart. Both lists
// are ascending.
std::vector<int> SelectSharpFrames(const std::vector<VideoFrame>& frames,
                                   const std::vector<timestamp_t>& starts);

// Extracts photos from a video with the programs ffmpeg and ffprobe (5.1 or
// later), and writes them and their times in the layout of an extraction from a
// bag, for FindBagFiles. Times are the container's. First pass: times and
// sharpness of all frames; second pass: the selected frames, as JPEG of the
// best quality. The programs' messages go to log_path. An error for a file that
// is no video, and without the programs.
StatusOr<BagExtraction> ExtractVideo(const std::string& video_path,
                                     const VideoExtractionOptions& options,
                                     const std::string& folder,
                                     const std::string& log_path,
                                     const ProgressCallback& progress);

}  // namespace adasfm
