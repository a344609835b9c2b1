// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"
#include "sensors/io/bag_logs.h"

namespace adasfm {

// Writes imu.csv, wheel.csv and gnss.csv, each if the bag has such messages, in
// the formats of docs/reference/sensors.md and formats.md.
Status WriteBagLogs(const BagLogs& logs, const std::string& folder);

// The calibration from a bag's frames and transforms, as the text of a
// sensors.yaml; the error names the frames that are not connected.
StatusOr<std::string> FormatBagCalibration(const std::string& bag_path,
                                           const BagLogs& logs);

}  // namespace adasfm
