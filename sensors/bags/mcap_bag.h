// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "sensors/bags/bag_reader.h"

namespace adasfm {

// MCAP (mcap.dev/spec): topics from the summary where there is one, else from
// all records; messages by going through the records, so that files without an
// index and files that were cut short are read alike. Chunks may be plain, lz4
// or zstd; one that is damaged (checksum) is left out with a warning. Messages
// in CDR and ROS 1's serialisation are read, others passed over.
StatusOr<std::unique_ptr<BagReader>> OpenMcapBag(const std::string& path);

}  // namespace adasfm
