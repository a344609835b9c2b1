// SPDX-License-Identifier: BSD-3-Clause
#include "memory_file.h"
#include "sensors/io/read_image_times.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  RequireAscending(ReadImageTimes(file.path()), /*strictly=*/false);
  timestamp_t time_ns = 0;
  const std::string name(reinterpret_cast<const char*>(data), size);
  if (ParseImageNameTime(name, &time_ns)) Require(time_ns >= 0);
  return 0;
}
