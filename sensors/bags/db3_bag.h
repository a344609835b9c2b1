// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "sensors/bags/bag_reader.h"

namespace adasfm {

// rosbag2's SQLite files: tables topics and messages, in CDR; messages may be
// compressed one by one with zstd. A file that cannot be read to its end gives
// what could be read, with a warning.
StatusOr<std::unique_ptr<BagReader>> OpenDb3Bag(const std::string& path);

}  // namespace adasfm
