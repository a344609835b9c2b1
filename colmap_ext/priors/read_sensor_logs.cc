// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/read_sensor_logs.h"

#include <utility>

#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"
#include "sensors/log_cleaning/clean_imu.h"
#include "sensors/log_cleaning/clean_wheel.h"

namespace adasfm {
namespace {

template <typename Sample>
void TakeCleaned(CleanedLog<Sample> cleaned, std::vector<Sample>* samples,
                 PriorImport* import) {
  *samples = std::move(cleaned.samples);
  import->log_faults.insert(import->log_faults.end(), cleaned.faults.begin(),
                            cleaned.faults.end());
  import->warnings.insert(import->warnings.end(), cleaned.warnings.begin(),
                          cleaned.warnings.end());
}

// Units are checked on the cleaned samples; if cleaning fails, on all samples,
// since a wrong unit may be the reason.
Status ReadImuLog(const std::string& path, SensorLogs* logs,
                  PriorImport* import) {
  LogOrigin origin;
  const StatusOr<std::vector<ImuSample>> imu =
      ReadImuSamples(path, &import->warnings, &origin);
  if (!imu.ok()) return imu.status();
  StatusOr<CleanedLog<ImuSample>> cleaned = CleanImu(*imu, origin);
  const Status units = cleaned.ok()
                           ? CheckImuUnits(cleaned->samples, cleaned->origin)
                           : CheckImuUnits(*imu, origin);
  if (!units.ok()) return units;
  if (!cleaned.ok()) return cleaned.status();
  TakeCleaned(std::move(*cleaned), &logs->imu, import);
  return Status::Ok();
}

Status ReadWheelLog(const std::string& path, WheelType type, SensorLogs* logs,
                    PriorImport* import) {
  LogOrigin origin;
  const StatusOr<std::vector<WheelSample>> wheel =
      ReadWheel(path, type, &import->warnings, &origin);
  if (!wheel.ok()) return wheel.status();
  StatusOr<CleanedLog<WheelSample>> cleaned = CleanWheel(*wheel, type, origin);
  const Status units =
      cleaned.ok() ? CheckWheelUnits(cleaned->samples, type, cleaned->origin)
                   : CheckWheelUnits(*wheel, type, origin);
  if (!units.ok()) return units;
  if (!cleaned.ok()) return cleaned.status();
  TakeCleaned(std::move(*cleaned), &logs->wheel, import);
  return Status::Ok();
}

}  // namespace

Status ReadSensorLogs(const PriorImportPaths& paths,
                      const SensorCalibration& calibration, SensorLogs* logs,
                      PriorImport* import) {
  if (!paths.imu_path.empty()) {
    const Status status = ReadImuLog(paths.imu_path, logs, import);
    if (!status.ok()) return status;
  }
  if (paths.wheel_path.empty()) return Status::Ok();
  if (!calibration.has_wheel) {
    return Status::Error(paths.sensors_path + " has no wheel0, which " +
                         paths.wheel_path + " needs; add it");
  }
  if (calibration.wheel_type != WheelType::kOdometry) {
    return ReadWheelLog(paths.wheel_path, calibration.wheel_type, logs, import);
  }
  StatusOr<std::vector<OdometryPose>> odometry =
      ReadOdometry(paths.wheel_path, &import->warnings);
  if (!odometry.ok()) return odometry.status();
  logs->odometry = std::move(odometry).value();
  return Status::Ok();
}

}  // namespace adasfm
