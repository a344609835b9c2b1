// SPDX-License-Identifier: BSD-3-Clause
#include "memory_file.h"
#include "sensors/io/read_imu.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  std::vector<std::string> warnings;
  RequireSoundImuLog(ReadImu(file.path(), &warnings));
  return 0;
}
