// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/automatic_reconstruction.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/host/color_points.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/io/run_manifest.h"
#include "colmap_ext/report/report.h"
#include "colmap_ext/workspace/open_workspace.h"
#include "colmap_ext/workspace/prepare_reconstruction.h"
#include "colmap_ext/workspace/reconstructor.h"
#include "core/option_checker.h"

namespace adasfm {

StatusOr<AutomaticReconstructionResult> Reconstructor::Run() {
  Status status = Prepare();
  if (status.ok()) status = Features();
  if (status.ok()) status = Matching();
  if (status.ok()) status = Priors();
  if (status.ok()) status = Coarse();
  if (status.ok()) status = Model();
  if (status.ok()) status = Report();
  if (status.ok()) status = ReadVerdict();
  if (!status.ok()) return status;
  return result_;
}

Status Reconstructor::RunStep(const std::string& name, const StepInputs& inputs,
                              const RunManifest::StepActions& actions) {
  const StatusOr<double> seconds =
      manifest_.Run(name, inputs, actions, message_);
  if (!seconds.ok()) return seconds.status();
  result_.steps.push_back({name, *seconds});
  return Status::Ok();
}

Status Reconstructor::Prepare() {
  std::string error;
  if (!options_.IsValid(&error)) throw std::invalid_argument(error);
  if (paths_.bag_path.empty() + paths_.video_path.empty() +
          paths_.image_path.empty() !=
      2) {
    return Status::Error(
        "give the photos as one of --image_path, --video_path and --bag_path");
  }
  Status status = PrepareOutputFolder(InWorkspace("logs"));
  if (!status.ok()) return status;
  const auto lock =
      FolderLock::Acquire(paths_.workspace_path, FolderLock::Mode::kExclusive);
  if (!lock.ok()) return lock.status();
  lock_ = *lock;
  // A bag's photos and logs are input only after they have been extracted.
  if (!HasRecording()) status = PrepareReconstruction(&options_, &paths_);
  if (!status.ok()) return status;
  database_path_ = InWorkspace("database.db");
  result_.model_path = InWorkspace("sparse/0");
  result_.report_path = InWorkspace("report.html");
  StatusOr<RunManifest> manifest =
      OpenWorkspace(paths_.workspace_path, options_.restart, message_);
  if (!manifest.ok()) return manifest.status();
  manifest_ = std::move(manifest).value();
  if (!HasRecording()) return Status::Ok();
  status = paths_.bag_path.empty() ? Video() : Bag();
  return status.ok() ? PrepareReconstruction(&options_, &paths_) : status;
}

Status Reconstructor::Coarse() {
  const StepInputs inputs = {
      {"refine_intrinsics", std::to_string(options_.map.refine_focal_length)}};
  const auto work = [this]() -> Status {
    const StatusOr<CoarseModelReport> report = EstimateCoarseModel(
        options_.global, database_path_, InWorkspace("coarse"),
        ProgressIn(kCoarse, "coarse model"));
    if (!report.ok()) return report.status();
    Warn(report->warnings);
    message_(FormatGlobalReportText(report->result, report->seconds));
    return Status::Ok();
  };
  return RunStep("coarse", inputs,
                 {&KeepAll, work, [this] { return CheckResult("coarse"); }});
}

Status Reconstructor::Model() {
  const auto work = [this]() -> Status {
    MapRequest request;
    request.database_path = database_path_;
    request.input_path = InWorkspace("coarse");
    request.output_path = InWorkspace("sparse");
    const StatusOr<MapReport> report =
        MapParts(options_.map, request, ProgressIn(kModel, "model"));
    if (!report.ok()) return report.status();
    message_(FormatMappingText(report->models));
    return ColorPoints(paths_.image_path, InWorkspace("sparse"),
                       InWorkspace("logs/colors.log"));
  };
  return RunStep("model", {},
                 {&KeepAll, work, [this] { return CheckResult("sparse"); }});
}

Status Reconstructor::Report() {
  const StatusOr<StepInputs> inputs =
      DigestPaths({{"ground_truth", paths_.ground_truth_path}});
  if (!inputs.ok()) return inputs.status();
  const auto work = [this]() -> Status {
    ProgressIn(kReport, "report")("drawing", 0.0);
    ReportOptions options;
    options.input_path = InWorkspace("sparse");
    options.coarse_path = InWorkspace("coarse");
    options.database_path = database_path_;
    options.image_path = paths_.image_path;
    options.ground_truth_path = paths_.ground_truth_path;
    options.ground_truth.image_times_path = paths_.image_times_path;
    const StatusOr<std::string> page = BuildReport(options);
    if (!page.ok()) return page.status();
    return WriteTextFile(result_.report_path, *page);
  };
  const auto check = [this] {
    std::error_code none;
    return std::filesystem::exists(result_.report_path, none)
               ? Status::Ok()
               : Status::Error(result_.report_path + " is missing");
  };
  return RunStep("report", *inputs, {&KeepAll, work, check});
}

Status Reconstructor::CheckResult(const std::string& folder) const {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const Status status =
        CheckBinaryModelFile(InWorkspace(folder + "/0/" + name));
    if (!status.ok()) return status;
  }
  const std::string summary = InWorkspace(folder + "/summary.json");
  std::error_code none;
  return std::filesystem::exists(summary, none)
             ? Status::Ok()
             : Status::Error(summary + " is missing");
}

Status Reconstructor::ReadVerdict() {
  const std::string path = InWorkspace("sparse/summary.json");
  std::ifstream file(path);
  const nlohmann::json json =
      nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  try {
    json.at("verdict").at("line").get_to(result_.verdict);
    result_.has_failed = json.at("verdict").at("result") == "failed";
  } catch (const nlohmann::json::exception&) {
    return Status::Error(path + " has no verdict; remove it and run again");
  }
  return Status::Ok();
}

bool AutomaticReconstructionOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
             .Require(std::abs(refine_intrinsics) <= 1, "refine_intrinsics",
                      refine_intrinsics, "must be -1, 0 or 1")
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .PositiveOrMinusOne("num_threads", num_threads)
             .AllHold() &&
         bag.photos.IsValid(error) && features.IsValid(error) &&
         pairs.IsValid(error) && priors.IsValid(error) &&
         global.IsValid(error) && map.IsValid(error);
}

StatusOr<AutomaticReconstructionResult> ReconstructAutomatically(
    const AutomaticReconstructionOptions& options,
    const AutomaticReconstructionPaths& paths, const ProgressCallback& progress,
    const MessageCallback& message) {
  return Reconstructor(options, paths, progress, message).Run();
}

}  // namespace adasfm
