// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "sensors/bags/bag_reader.h"

namespace adasfm {

// Reads MCAP (mcap.dev/spec). Topics come from the summary where there is one,
// else from all records. Messages are found by scanning the records, so that
// files without an index and files that were cut short are read alike. Chunks
// may be plain, lz4 or zstd; a damaged one (checksum) is left out with a
// warning. Messages in CDR and ROS 1's serialisation are read, others are
// skipped.
StatusOr<std::unique_ptr<BagReader>> OpenMcapBag(const std::string& path);

}  // namespace adasfm
