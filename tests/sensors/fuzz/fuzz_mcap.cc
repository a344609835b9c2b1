// SPDX-License-Identifier: BSD-3-Clause
#include "memory_file.h"
#include "sensors/bags/mcap_bag.h"

// Any bytes as an MCAP file: every message is visited and its bytes are read.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  const StatusOr<std::unique_ptr<BagReader>> bag = OpenMcapBag(file.path());
  if (!bag.ok()) {
    Require(!bag.status().message().empty());
    Require(bag.status().message().find('\n') == std::string::npos);
    return 0;
  }
  std::set<std::string> topics;
  for (const BagTopic& topic : (*bag)->Topics()) topics.insert(topic.name);
  std::vector<std::string> warnings;
  uint64_t sum = 0;
  const Status status = (*bag)->Read(
      topics,
      [&](const BagMessage& message) {
        Require(message.topic != nullptr);
        for (size_t i = 0; i < message.bytes.size; ++i) {
          sum += message.bytes.data[i];
        }
        return Status::Ok();
      },
      &warnings);
  Require(status.ok());
  return 0;
}
