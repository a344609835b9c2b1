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

// The position of a packet: columns 1-3, and pos_accuracy (column 24), 1 sigma
// in m.
struct KittiOxtsFix {
  timestamp_t timestamp_ns = 0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
  double sigma_m = 0.0;  // 0: not stated
};
StatusOr<std::vector<KittiOxtsFix>> ReadKittiOxtsFixes(
    const std::string& folder);

}  // namespace adasfm
