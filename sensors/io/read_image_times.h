// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"

namespace adasfm {

// Reads image times, which must not decrease; images of one frame of a rig have
// equal times. Formats: EuRoC data.csv ("ns,filename"), 4Seasons times.txt ("id
// seconds exposure"; the name is "<id>.png") or TUM rgb.txt ("seconds
// filename"; the name is without its folder).
StatusOr<std::vector<ImageTime>> ReadImageTimes(const std::string& path);

// The time in an image's name when its digits are nanoseconds
// ("1600000003200000000.png"); false otherwise.
bool ParseImageNameTime(const std::string& name, timestamp_t* timestamp_ns);

}  // namespace adasfm
