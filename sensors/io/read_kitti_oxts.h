// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/sensor_log.h"
#include "core/status.h"

namespace adasfm {

// Reads the IMU of a KITTI raw "oxts" folder: timestamps.txt (one date and time
// a line) and data/<index>.txt, whose columns 12-14 and 18-20 (from 1) are
// acceleration and angular velocity in the body frame. Times count from 1970.
StatusOr<std::vector<ImuSample>> ReadKittiOxts(const std::string& folder);

}  // namespace adasfm
