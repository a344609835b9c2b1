// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "memory_file.h"
#include "sensors/io/read_wheel.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  const auto log = ReadOdometry(file.path());
  RequireAscending(log);
  if (!log.ok()) return 0;
  for (const OdometryPose& pose : *log) {
    Require(pose.world_from_body.translation.allFinite());
    Require(std::abs(pose.world_from_body.rotation.norm() - 1.0) < 1e-9);
  }
  return 0;
}
