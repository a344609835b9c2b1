// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/position_prior.h"
#include "core/status.h"

namespace adasfm {

// 1 sigma of a fix whose log states none, m (docs/reference/sensors.md, gnss0).
struct GnssNoise {
  double horizontal_m = 2.0;  // in east and in north, at a HDOP of 1
  double vertical_m = 4.0;
};

struct GnssLog {
  // Ascending times, on the receiver's clock.
  std::vector<GnssFix> fixes;
  // Lines without a usable position, by reason.
  std::map<std::string, int> num_left_out;
};

// Reads a log of positions; its format is recognised by path and content
// (docs/reference/sensors.md):
//   a CSV file whose header names the columns,
//   NMEA 0183 sentences (GGA or RMC, with RMC or ZDA for the date, and GST),
//   a KITTI raw "oxts" folder,
//   a bag with sensor_msgs/NavSatFix ("drive.mcap" or "drive.mcap:/fix").
// Longitudes may be 0 to 360. Errors name the line: columns that are missing or
// not numbers, latitudes beyond 90 degrees (swapped columns), times that go
// back. A log without any position is an error, too.
StatusOr<GnssLog> ReadGnss(const std::string& path, const GnssNoise& noise,
                           std::vector<std::string>* warnings);

}  // namespace adasfm
