// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/status.h"
#include "core/types.h"
#include "sensors/estimate_priors.h"

namespace adasfm {

// Sorts the images by time; an error when two images have the same time.
StatusOr<std::vector<ImageStamp>> OrderImages(std::vector<ImageStamp> images);

// The images whose time on the logs' clock (the camera's plus the shift) lies
// between the logs' start and end; an error that names both spans when there is
// none. Needs images in order of time, one at least.
StatusOr<std::vector<ImageStamp>> SelectImages(
    const std::vector<ImageStamp>& images, timestamp_t timeshift_ns,
    timestamp_t start_ns, timestamp_t end_ns);

}  // namespace adasfm
