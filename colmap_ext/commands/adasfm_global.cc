// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/global_report.h"

namespace adasfm {
namespace {

struct GlobalCommandOptions {
  std::string database_path;
  std::string output_path;
  GlobalStageOptions stage;
};

void AddOptions(GlobalCommandOptions* options, CommandOptions* command) {
  GlobalStageOptions* stage = &options->stage;
  const auto add = [command](const std::string& name, auto* value,
                             const std::string& help) {
    command->AddDefault("AdaSfmGlobal." + name, value, help);
  };
  command->AddRequired("database_path", &options->database_path,
                       "COLMAP database with verified matches");
  command->AddRequired("output_path", &options->output_path,
                       "folder for the coarse model (0, 1, ...)");
  add("max_prior_time_gap_s", &stage->poses.augmentation.max_prior_time_gap_s,
      "sensor priors over longer times are no edges [s]");
  add("max_rotation_discrepancy_deg",
      &stage->poses.max_rotation_discrepancy_deg,
      "pairs farther from the global rotations are removed [deg]");
  add("min_triangulation_angle_deg",
      &stage->structure.triangulation.min_triangulation_angle_deg,
      "least angle of a point's rays [deg]");
  add("min_angle_floor_deg", &stage->structure.min_angle_floor_deg,
      "least angle for images with few points [deg]");
  add("max_epipolar_error_px", &stage->refinement.max_epipolar_error_px,
      "matches farther from their epipolar lines, both views together, are "
      "dropped [px]");
  add("min_num_matches", &stage->refinement.min_num_matches,
      "pairs with fewer matches are removed");
  add("min_num_tracks_per_image",
      &stage->structure.tracks.min_num_tracks_per_image,
      "tracks are taken while an image has fewer");
  add("max_num_tracks", &stage->structure.tracks.max_num_tracks,
      "largest number of tracks; -1: no bound");
  add("ba_refine_focal_length", &stage->structure.bundle.refine_focal_length,
      "adjust focal lengths too");
  add("num_threads", &stage->num_threads, "threads; -1: all of the machine's");
  // What each step buys: ablations.
  add("use_sdp_start", &stage->poses.rotations.use_sdp_start,
      "start the rotations from the SDP");
  add("use_loop_gating", &stage->poses.loops.enabled,
      "remove loops that the odometry excludes");
  add("refine_relative_poses", &stage->poses.relative_poses.enabled,
      "least-squares relative poses");
  add("refine_translations", &stage->poses.translations.enabled,
      "directions anew under the global rotations");
  add("use_augmentation", &stage->poses.augmentation.enabled,
      "sensor edges and translations in the view graph");
  add("use_metric_lengths", &stage->poses.augmentation.use_metric_lengths,
      "keep the sensors' lengths (0: the paper's unit vectors)");
  add("ba_use_priors", &stage->structure.use_priors,
      "sensor priors in the bundle adjustment");
  add("refine_matches", &stage->refinement.enabled,
      "rewrite the database's two-view geometries");
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
  const Status status = command.Parse(argc, argv);
  if (!status.ok() || command.HelpShown()) return status;

  ProgressDisplay display;
  const StatusOr<CoarseModelReport> report = EstimateCoarseModel(
      options.stage, options.database_path, options.output_path,
      [&display](const std::string& what, double share_done) {
        display.Update(what, share_done);
      });
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
