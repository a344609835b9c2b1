// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace adasfm {

struct CapturedImage {
  image_t image_id = kInvalidImageId;
  std::string name;
  std::optional<timestamp_t> timestamp_ns;
};

// Sorts by time if all images have one, else by name with runs of digits as
// numbers. Ids are not in capture order: COLMAP assigns them in the order in
// which its threads finish the features. by_time may be null.
std::vector<image_t> OrderByCapture(std::vector<CapturedImage> images,
                                    bool* by_time = nullptr);

}  // namespace adasfm
