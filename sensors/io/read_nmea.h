// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "sensors/io/log_file.h"
#include "sensors/io/read_gnss.h"

namespace adasfm {

// Whether the first data line begins as a sentence of NMEA 0183 does.
bool IsNmea(const LogFile& file);

// Reads positions from sentences of NMEA 0183, of any talker ($GPGGA, $GNRMC):
// GGA gives position, height above the ellipsoid (altitude plus separation of
// the geoid) and HDOP, GST the sigmas, RMC or ZDA the date that GGA lacks.
// Times are UTC. Sentences of one epoch (equal times of day) are one fix. RMC
// alone has no height: positions then are of height 0, with a large sigma.
// Sentences with a wrong checksum, and positions before the first date, are
// left out and counted.
StatusOr<GnssLog> ReadNmea(const LogFile& file, const GnssNoise& noise,
                           std::vector<std::string>* warnings);

}  // namespace adasfm
