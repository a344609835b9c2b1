// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "sensors/bags/bag_reader.h"

namespace adasfm {

// Whether this build reads ROS 1 bags (docs/guide/install.md).
bool CanReadRos1Bags();

// ROS 1 bags (format 2.0, closed) by librosbag-storage; in a build without it
// an error that says so.
StatusOr<std::unique_ptr<BagReader>> OpenRos1Bag(const std::string& path);

}  // namespace adasfm
