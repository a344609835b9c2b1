// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "memory_file.h"
#include "sensors/io/read_wheel.h"
#include "sensors/preintegration/wheel_odometry.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  const StatusOr<WheelType> type = ReadWheelType(file.path());
  if (!type.ok() || *type == WheelType::kOdometry) return 0;
  const auto log = ReadWheel(file.path(), *type);
  RequireAscending(log);
  if (!log.ok()) return 0;
  SensorCalibration calibration;
  calibration.wheel_type = *type;
  calibration.metres_per_tick = 0.01;
  for (const WheelSpeed& speed : ComputeWheelSpeeds(*log, calibration)) {
    Require(std::isfinite(speed.speed) && std::isfinite(speed.yaw_rate));
  }
  return 0;
}
