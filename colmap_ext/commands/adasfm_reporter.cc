// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/report/report.h"
#include "core/check_options.h"

namespace adasfm {

Status RunAdasfmReporter(int argc, char** argv) {
  ReportOptions options;
  std::string output_path;
  CommandOptions command("adasfm_reporter",
                         "Writes a report of a model and its reconstruction as "
                         "one HTML file that needs no network.");
  command.AddRequired("output_path", &output_path, "HTML file to write");
  command.AddRequired(
      "input_path", &options.input_path,
      "model folder, or a folder of models, of which the largest is shown; the "
      "summary of adasfm_mapper beside the models is also read");
  command.AddDefault("coarse_path", &options.coarse_path,
                     "model folder or folder of models of adasfm_global; its "
                     "summary and removed pairs are also read");
  command.AddDefault("database_path", &options.database_path,
                     "COLMAP database, for the priors and the view graph; the "
                     "summary of adasfm_prior_importer beside it is read too");
  command.AddDefault("image_path", &options.image_path,
                     "folder of the photos, for examples of removed and kept "
                     "pairs with their matches (needs --database_path)");
  command.AddDefault("ground_truth_path", &options.ground_truth_path,
                     "true poses: a COLMAP model, a TUM trajectory, or lines "
                     "`name qw qx qy qz tx ty tz` (cam_from_world)");
  command.AddDefault("image_times_path", &options.ground_truth.image_times_path,
                     "image times, for a ground-truth trajectory; when empty, "
                     "the digits of an image name are nanoseconds");
  command.AddDefault(
      "max_time_gap_s", &options.ground_truth.max_time_gap_s,
      "largest gap between trajectory poses that is interpolated [s]");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  Status valid = CheckOptions(options);
  if (valid.ok()) {
    valid = CheckOutputIsNoInput(
        output_path,
        {{"database_path", options.database_path},
         {"ground_truth_path", options.ground_truth_path},
         {"image_times_path", options.ground_truth.image_times_path}});
  }
  if (!valid.ok()) return valid;
  const StatusOr<std::string> page = BuildReport(options);
  if (!page.ok()) return page.status();
  const Status written = WriteTextFile(output_path, *page);
  if (written.ok()) {
    std::cout << "Report: " << output_path << std::endl;
  }
  return written;
}

}  // namespace adasfm
