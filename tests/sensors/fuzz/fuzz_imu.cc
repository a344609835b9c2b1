// SPDX-License-Identifier: BSD-3-Clause
#include "memory_file.h"
#include "sensors/read_imu.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  std::vector<std::string> warnings;
  const auto log = ReadImu(file.path(), &warnings);
  RequireAscending(log);
  if (!log.ok()) return 0;
  for (const ImuSample& sample : *log) {
    Require(sample.angular_velocity.allFinite());
    Require(sample.specific_force.allFinite());
  }
  return 0;
}
