// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/commands/mapper_options.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/mapper_stage/verdict_report.h"
#include "core/check_options.h"

namespace adasfm {
namespace {

struct MapperCommandOptions {
  std::string stage = "all";
  MapRequest request;
  MapOptions map;
};

StatusOr<MapperSteps> StepsFromName(const std::string& name) {
  if (name == "all") return MapperSteps::kAll;
  if (name == "plan") return MapperSteps::kPlan;
  if (name == "part") return MapperSteps::kPart;
  if (name == "merge") return MapperSteps::kMerge;
  return Status::Error("AdaSfmMapper.stage = " + name +
                       " must be all, plan, part or merge");
}

}  // namespace

Status RunAdasfmMapper(int argc, char** argv) {
  MapperCommandOptions options;
  CommandOptions command(
      "adasfm_mapper",
      "Divides each coarse model into overlapping parts, reconstructs the "
      "parts incrementally, guided by the coarse poses, and merges them.");
  command.AddRequired("database_path", &options.request.database_path,
                      "COLMAP database with verified matches");
  command.AddRequired("input_path", &options.request.input_path,
                      "folder of the coarse models 0, 1, ... that "
                      "adasfm_global made, or one of them");
  command.AddRequired("output_path", &options.request.output_path,
                      "folder for the models (0, 1, ..., one for each coarse "
                      "model) and checkpoints");
  command.AddDefault("existing_path", &options.request.existing_path,
                     "model that is extended: its images, known by their "
                     "names, keep their poses, and the others are added to it");
  command.AddDefault("AdaSfmMapper.stage", &options.stage,
                     "what to run: all, plan, part or merge");
  command.AddDefault("AdaSfmMapper.part_index", &options.request.part_index,
                     "index of the part for --AdaSfmMapper.stage part, from 0");
  AddMapperOptions(&options.map, &command);
  Status status = command.Parse(argc, argv);
  if (!status.ok() || command.HelpShown()) return status;
  status = command.Check([&options] { return CheckOptions(options.map); });
  if (!status.ok()) return status;
  const StatusOr<MapperSteps> steps = StepsFromName(options.stage);
  if (!steps.ok()) return steps.status();
  options.request.steps = *steps;
  if (options.request.part_index != -1 && *steps != MapperSteps::kPart) {
    return Status::Error(
        "--AdaSfmMapper.part_index is for --AdaSfmMapper.stage part only");
  }

  ProgressDisplay display;
  const StatusOr<MapReport> report =
      MapParts(options.map, options.request, display.Callback());
  display.Finish();
  if (!report.ok()) return report.status();
  for (const std::string& warning : report->warnings) {
    std::cout << "WARNING: " << warning << std::endl;
  }
  if (*steps == MapperSteps::kAll || *steps == MapperSteps::kMerge) {
    std::cout << FormatMappingText(report->models) << std::flush;
  }
  if (!report->verdict) return Status::Ok();
  if (report->verdict->result == VerdictResult::kFailed) {
    return Status::Error(FormatVerdict(*report->verdict));
  }
  std::cout << FormatVerdict(*report->verdict) << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
