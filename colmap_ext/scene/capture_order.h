// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace adasfm {

struct CapturedImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  std::optional<timestamp_t> timestamp_ns;
  int drive = -1;  // SceneImage::drive
};

// Sorts by time if all images have one, else by name with runs of digits as
// numbers. Ids are not in capture order: COLMAP assigns them in the order in
// which its threads finish the features. by_time may be null.
std::vector<image_t> OrderByCapture(std::vector<CapturedImage> images,
                                    bool* by_time = nullptr);

// As ViewGraph::capture_ranks and capture_positions. The ranks of drives that
// overlap in the order of capture, as those of several robots at the same time,
// begin at different multiples of kRankGapOfDrives.
struct CaptureRank {
  int64_t rank = 0;
  int64_t position = 0;
};
std::map<image_t, CaptureRank> RankByCapture(
    const std::vector<CapturedImage>& images);

}  // namespace adasfm
