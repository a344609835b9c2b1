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
  // Of the video's time 0 on the clock of the logs [ns].
  timestamp_t start_ns = 0;
  // The wheel log that photos.image_distance_m is measured by; empty: none.
  std::string wheel_path;
};

// A frame of a video.
struct VideoFrame {
  timestamp_t time_ns = 0;
  // The width of its edges as ffmpeg's blurdetect tells [px]; infinity where
  // there are none.
  double blur_px = 0.0;
};

// The index of a frame for each time in `starts`: the sharpest one from there
// to half way to the next, so that the frames stay apart. Both are ascending.
std::vector<int> SelectSharpFrames(const std::vector<VideoFrame>& frames,
                                   const std::vector<timestamp_t>& starts);

// Takes photos out of a video with the programs ffmpeg and ffprobe (5.1 or
// later), and writes them with their times where an extraction from a bag does
// (FindBagFiles finds them). Times are the container's. First pass: times and
// sharpness of all frames; second pass: those selected, as JPEG of the best
// quality. What the programs say goes to log_path. An error for a file that is
// no video, and without the programs.
StatusOr<BagExtraction> ExtractVideo(const std::string& video_path,
                                     const VideoExtractionOptions& options,
                                     const std::string& folder,
                                     const std::string& log_path,
                                     const ProgressCallback& progress);

}  // namespace adasfm
