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

// By time where all images have one, else by name with runs of digits as
// numbers. Ids are no order of capture: COLMAP gives them as its threads finish
// with the features. by_time may be null.
std::vector<image_t> OrderByCapture(std::vector<CapturedImage> images,
                                    bool* by_time = nullptr);

}  // namespace adasfm
