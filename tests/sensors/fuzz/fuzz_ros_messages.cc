// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include "memory_file.h"
#include "sensors/bags/ros_messages.h"

namespace adasfm {
namespace {

// Reads all bytes that a message refers to; they must be valid memory.
void Touch(const ByteSpan& bytes) {
  uint64_t sum = 0;
  for (size_t i = 0; i < bytes.size; ++i) sum += bytes.data[i];
  volatile uint64_t sink = sum;
  (void)sink;
}

template <typename Message>
void Parse(RosEncoding encoding, const ByteSpan& bytes) {
  Message message;
  if (!ParseRosMessage(encoding, bytes, &message)) return;
  if constexpr (std::is_same_v<Message, RosImage>) Touch(message.pixels);
  if constexpr (std::is_same_v<Message, RosCompressedImage>) {
    Touch(message.file);
  }
}

template <typename... Messages>
void ParseAll(RosEncoding encoding, const ByteSpan& bytes) {
  (Parse<Messages>(encoding, bytes), ...);
}

}  // namespace
}  // namespace adasfm

// Any bytes as a message of every type, in both serialisations: what the .db3
// and MCAP readers hand over.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const ByteSpan bytes{data, size};
  for (const RosEncoding encoding : {RosEncoding::kCdr, RosEncoding::kRos1}) {
    ParseAll<RosImu, RosImage, RosCompressedImage, RosCameraInfo, RosNavSatFix,
             RosJointState, RosTwist, RosOdometry, std::vector<RosTransform>>(
        encoding, bytes);
    RosHeader header;
    ParseRosHeader(encoding, bytes, &header);
  }
  return 0;
}
