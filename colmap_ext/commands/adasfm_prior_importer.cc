// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/commands/importer_options.h"
#include "colmap_ext/commands/log_options.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/io/output_files.h"
#include "core/check_options.h"

namespace adasfm {
namespace {

void AddPathOptions(PriorImportPaths* paths, CommandOptions* command) {
  command->AddRequired("database_path", &paths->database_path,
                       "COLMAP database with the images");
  command->AddDefault("sensors_path", &paths->sensors_path,
                      "YAML file with the calibration of the sensors; not "
                      "needed for a trajectory of the camera");
  AddLogOptions(paths, command);
  command->AddDefault("bag_path", &paths->bag_path,
                      "a ROS 2 bag (.mcap, .db3 or bag folder) or a ROS 1 bag, "
                      "for the logs for which no path is given");
  AddBagTopicOptions(&paths->bag_topics, command);
  command->AddDefault(
      "trajectory_path", &paths->trajectory_path,
      "in place of logs: metric poses as a TUM trajectory or a COLMAP model; "
      "the relative poses of images become priors");
}

}  // namespace

Status RunAdasfmPriorImporter(int argc, char** argv) {
  PriorImportPaths paths;
  PriorImportOptions options;
  bool force = false;
  std::string summary_path;
  CommandOptions command("adasfm_prior_importer",
                         "Computes pose priors from IMU, wheel and GNSS logs "
                         "and stores them in the database.");
  AddPathOptions(&paths, &command);
  command.AddDefault(
      "force", &force,
      "import even if the sensors contradict vision or each other (0 or 1)");
  command.AddDefault("summary_path", &summary_path,
                     "file for the summary as JSON; when empty, the database "
                     "path followed by .priors.json");
  AddImporterOptions(&options, &command);
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  const Status valid =
      command.Check([&options] { return CheckOptions(options); });
  if (!valid.ok()) return valid;
  options.estimation.check_against_vision = !force;
  if (summary_path.empty()) summary_path = paths.database_path + ".priors.json";
  const Status apart = CheckOutputIsNoInput(
      summary_path, {{"database_path", paths.database_path},
                     {"image_times_path", paths.image_times_path},
                     {"imu_path", paths.imu_path},
                     {"wheel_path", paths.wheel_path},
                     {"gnss_path", paths.gnss_path},
                     {"sensors_path", paths.sensors_path}});
  if (!apart.ok()) return apart;

  const StatusOr<PriorImport> import =
      ImportPriors(options, paths, summary_path);
  if (!import.ok()) return import.status();
  std::cout << FormatPriorImport(*import) << "Priors written to "
            << paths.database_path << ", summary to " << summary_path
            << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
