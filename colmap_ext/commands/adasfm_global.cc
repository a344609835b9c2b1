// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/commands/global_options.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "core/check_options.h"

namespace adasfm {
namespace {

struct GlobalCommandOptions {
  std::string database_path;
  std::string output_path;
  GlobalStageOptions stage;
};

void AddOptions(GlobalCommandOptions* options, CommandOptions* command) {
  command->AddRequired("database_path", &options->database_path,
                       "COLMAP database with verified matches");
  command->AddRequired("output_path", &options->output_path,
                       "folder for the coarse models (0, 1, ...)");
  AddGlobalOptions(&options->stage, command);
}

}  // namespace

Status RunAdasfmGlobal(int argc, char** argv) {
  GlobalCommandOptions options;
  CommandOptions command(
      "adasfm_global",
      "Coarse global SfM on verified matches and sensor priors; writes a "
      "coarse model and cleans the database's two-view geometries "
      "(adasfm_restorer undoes that).");
  AddOptions(&options, &command);
  Status status = command.Parse(argc, argv);
  if (!status.ok() || command.HelpShown()) return status;
  status = command.Check([&options] { return CheckOptions(options.stage); });
  if (!status.ok()) return status;

  ProgressDisplay display;
  const StatusOr<CoarseModelReport> report =
      EstimateCoarseModel(options.stage, options.database_path,
                          options.output_path, display.Callback());
  display.Finish();
  if (!report.ok()) return report.status();
  for (const std::string& warning : report->warnings) {
    std::cout << "WARNING: " << warning << std::endl;
  }
  std::cout << FormatGlobalReportText(report->result, report->seconds)
            << std::flush;
  return Status::Ok();
}

}  // namespace adasfm
