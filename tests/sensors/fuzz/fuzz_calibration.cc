// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "memory_file.h"
#include "sensors/io/calibration.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  const StatusOr<SensorCalibration> calibration =
      ReadSensorCalibration(file.path());
  if (!calibration.ok()) {
    Require(!calibration.status().message().empty());
    Require(calibration.status().message().find('\n') == std::string::npos);
    return 0;
  }
  Require(calibration->cam_from_imu.translation.allFinite());
  Require(calibration->imu_from_wheel.translation.allFinite());
  Require(std::abs(calibration->cam_from_imu.rotation.norm() - 1.0) < 1e-9);
  Require(std::isfinite(calibration->timeshift_cam_imu_s));
  Require(calibration->imu_rate_hz > 0.0);
  Require(calibration->track_width_m > 0.0);
  return 0;
}
