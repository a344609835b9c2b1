// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/workspace/reconstructor.h"
#include "colmap_ext/workspace/reset_workspace.h"

namespace adasfm {

Status Reconstructor::ImportForPairs(const std::string& database_path) const {
  if (!HasMotionLogs()) return Status::Ok();
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path);
  if (!tables.ok() || !tables->tables.priors.empty()) return tables.status();
  return Import(database_path).status();
}

StatusOr<PriorImport> Reconstructor::Import(
    const std::string& database_path) const {
  PriorImportPaths paths;
  paths.database_path = database_path;
  paths.image_times_path = paths_.image_times_path;
  paths.imu_path = paths_.imu_path;
  paths.wheel_path = paths_.wheel_path;
  paths.gnss_path = paths_.gnss_path;
  paths.sensors_path = paths_.sensors_path;
  return ImportPriors(options_.priors, paths, database_path + ".priors.json");
}

StatusOr<StepInputs> Reconstructor::DigestSensors() const {
  // "database" is not a file.
  const bool has_stored_positions = paths_.gnss_path == "database";
  StatusOr<StepInputs> inputs =
      DigestPaths({{"image_times", paths_.image_times_path},
                   {"imu", paths_.imu_path},
                   {"wheel", paths_.wheel_path},
                   {"gnss", has_stored_positions ? "" : paths_.gnss_path},
                   {"sensors", paths_.sensors_path}});
  if (inputs.ok() && has_stored_positions) {
    inputs.value()["gnss"] = paths_.gnss_path;
  }
  return inputs;
}

Status Reconstructor::Priors() {
  const StatusOr<StepInputs> inputs = DigestSensors();
  if (!inputs.ok()) return inputs.status();
  const auto reset = [this] { return ResetPriors(database_path_); };
  const bool has_motion_logs = HasMotionLogs();
  const bool has_sensors = has_motion_logs || !paths_.gnss_path.empty();
  const auto work = [&]() -> Status {
    if (!has_sensors) return Status::Ok();
    ProgressIn(kPriors, "priors")("reading the logs", 0.0);
    const StatusOr<PriorImport> import = Import(database_path_);
    if (!import.ok()) return import.status();
    message_(FormatPriorImport(*import));
    return Status::Ok();
  };
  const auto check = [&]() -> Status {
    if (!has_sensors) return Status::Ok();
    const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path_);
    if (!tables.ok()) return tables.status();
    const bool is_missing = has_motion_logs ? tables->tables.image_times.empty()
                                            : tables->tables.positions.empty();
    return is_missing
               ? Status::Error("the priors are missing in " + database_path_)
               : Status::Ok();
  };
  return RunStep("priors", *inputs, {reset, work, check});
}

}  // namespace adasfm
