// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/automatic_reconstruction.h"

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "colmap_ext/bags/extract_video.h"
#include "colmap_ext/coarse/global_report.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/features/extract_sift.h"
#include "colmap_ext/host/color_points.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/io/step_journal.h"
#include "colmap_ext/pairs/predict_motions.h"
#include "colmap_ext/report/report.h"
#include "colmap_ext/workspace/open_workspace.h"
#include "colmap_ext/workspace/prepare_reconstruction.h"
#include "colmap_ext/workspace/recording.h"
#include "colmap_ext/workspace/reset_workspace.h"
#include "sensors/io/calibration.h"

namespace adasfm {
namespace {

// Steps whose files are replaced have nothing to remove beforehand.
Status KeepAll() { return Status::Ok(); }

class Reconstructor {
 public:
  Reconstructor(const AutomaticReconstructionOptions& options,
                const AutomaticReconstructionPaths& paths,
                const ProgressCallback& progress,
                const MessageCallback& message)
      : options_(options),
        paths_(paths),
        progress_(progress),
        message_(message) {}

  StatusOr<AutomaticReconstructionResult> Run() {
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

 private:
  // The shares of the steps in the time of all; with CPU features matching is
  // most of it.
  struct Range {
    double begin;
    double end;
  };
  static constexpr Range kBag{0.0, 0.0}, kFeatures{0.0, 0.2},
      kMatching{0.2, 0.75}, kPriors{0.75, 0.77}, kCoarse{0.77, 0.85},
      kModel{0.85, 0.99}, kReport{0.99, 1.0};

  std::string InWorkspace(const std::string& name) const {
    return paths_.workspace_path + "/" + name;
  }

  ProgressCallback ProgressIn(const Range& range, const std::string& title) {
    return [this, range, title](const std::string& what, double share_done) {
      progress_(title + ": " + what,
                range.begin + (range.end - range.begin) * share_done);
    };
  }

  void Warn(const std::vector<std::string>& warnings) {
    for (const std::string& warning : warnings) {
      message_("WARNING: " + warning);
    }
  }

  Status RunStep(const std::string& name, const StepInputs& inputs,
                 const StepJournal::StepActions& actions) {
    const StatusOr<double> seconds =
        journal_.Run(name, inputs, actions, message_);
    if (!seconds.ok()) return seconds.status();
    result_.steps.push_back({name, *seconds});
    return Status::Ok();
  }

  Status Prepare();
  // Photos are taken out of a file first.
  bool HasRecording() const {
    return !paths_.bag_path.empty() || !paths_.video_path.empty();
  }
  Status Bag();
  Status Video();
  // Does a step that takes photos out of a file.
  Status RunExtraction(
      const StepInputs& inputs,
      const std::function<StatusOr<BagExtraction>(const std::string&)>&
          extract);
  Status Features();
  Status ExtractAll(const std::vector<std::string>& names);
  Status Matching();
  Status MatchSelected(const std::vector<ImagePair>& pairs,
                       const ProgressCallback& progress);
  Status Priors();
  bool HasMotionLogs() const {
    return !paths_.imu_path.empty() || !paths_.wheel_path.empty();
  }
  StatusOr<StepInputs> DigestSensors() const;
  StatusOr<PriorImport> Import() const;
  // Before the matching, without the photos' rotations: for the choice of
  // pairs, and so that faults of the logs are known before the long work. A run
  // that goes on takes what is there, so that it chooses the same pairs.
  Status ImportForPairs(const ProgressCallback& progress) const;
  Status Coarse();
  Status Model();
  Status Report();
  Status ReadVerdict();
  // A model and its summary in a folder of the workspace.
  Status CheckResult(const std::string& folder) const;

  AutomaticReconstructionOptions options_;
  AutomaticReconstructionPaths paths_;
  const ProgressCallback& progress_;
  const MessageCallback& message_;
  std::string database_path_;
  std::shared_ptr<FolderLock> lock_;
  StepJournal journal_;
  AutomaticReconstructionResult result_;
};

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
  // A bag's photos and logs are input as any others once they are files.
  if (!HasRecording()) status = PrepareReconstruction(&options_, &paths_);
  if (!status.ok()) return status;
  database_path_ = InWorkspace("database.db");
  result_.model_path = InWorkspace("sparse/0");
  result_.report_path = InWorkspace("report.html");
  StatusOr<StepJournal> journal =
      OpenWorkspace(paths_.workspace_path, options_.restart, message_);
  if (!journal.ok()) return journal.status();
  journal_ = std::move(journal).value();
  if (!HasRecording()) return Status::Ok();
  status = paths_.bag_path.empty() ? Video() : Bag();
  return status.ok() ? PrepareReconstruction(&options_, &paths_) : status;
}

Status Reconstructor::Bag() {
  BagExtractionOptions& bag = options_.bag;
  bag.has_calibration = !paths_.sensors_path.empty();
  if (bag.has_calibration) {
    const StatusOr<SensorCalibration> calibration =
        ReadSensorCalibration(paths_.sensors_path);
    if (!calibration.ok()) return calibration.status();
    if (calibration->has_wheel) bag.wheel_type = calibration->wheel_type;
  }
  StatusOr<StepInputs> inputs = DigestBag(paths_.bag_path, bag);
  if (!inputs.ok()) return inputs.status();
  return RunExtraction(*inputs, [&](const std::string& folder) {
    return ExtractBag(paths_.bag_path, bag, folder, ProgressIn(kBag, "bag"));
  });
}

Status Reconstructor::Video() {
  if (!std::filesystem::is_regular_file(paths_.video_path)) {
    return Status::Error("the video " + paths_.video_path + " is not there");
  }
  VideoExtractionOptions video;
  video.photos = options_.bag.photos;
  video.start_ns = options_.video_start_ns;
  video.wheel_path = paths_.wheel_path;
  StepInputs inputs = DigestVideo(paths_.video_path, video);
  if (video.photos.image_distance_m > 0.0) {
    const StatusOr<StepInputs> wheel =
        DigestPaths({{"wheel", paths_.wheel_path}});
    if (!wheel.ok()) return wheel.status();
    inputs.insert(wheel->begin(), wheel->end());
  }
  return RunExtraction(inputs, [&](const std::string& folder) {
    return ExtractVideo(paths_.video_path, video, folder,
                        InWorkspace("logs/video.log"),
                        ProgressIn(kBag, "video"));
  });
}

Status Reconstructor::RunExtraction(
    const StepInputs& inputs,
    const std::function<StatusOr<BagExtraction>(const std::string&)>& extract) {
  const std::string folder = BagFolder(paths_.workspace_path);
  const auto reset = [&folder] { return RemoveBagFiles(folder); };
  const auto work = [&]() -> Status {
    const StatusOr<BagExtraction> extraction = extract(folder);
    if (!extraction.ok()) return extraction.status();
    Warn(extraction->warnings);
    message_(extraction->summary);
    return Status::Ok();
  };
  const auto check = [&folder] {
    const BagFiles files = FindBagFiles(folder);
    return files.image_path.empty() || files.image_times_path.empty()
               ? Status::Error("there are no photos in " + folder)
               : Status::Ok();
  };
  const Status status = RunStep(kBagStep, inputs, {reset, work, check});
  if (status.ok()) UseBagFiles(FindBagFiles(folder), &options_, &paths_);
  return status;
}

Status Reconstructor::ExtractAll(const std::vector<std::string>& names) {
  const ProgressCallback progress = ProgressIn(kFeatures, "features");
  const StatusOr<ImageRegistration> images = RegisterImages(
      options_.features, paths_.image_path, names, database_path_,
      [&progress](const std::string& what, double share_done) {
        progress(what, 0.1 * share_done);
      });
  if (!images.ok()) return images.status();
  std::ostringstream text;
  text << "features: " << images->num_images << " photos, "
       << images->num_cameras
       << (images->num_cameras == 1 ? " camera" : " cameras");
  if (options_.features.camera_params.empty()) {
    text << ", focal lengths from EXIF: " << images->num_known_focal_lengths
         << ", guessed: "
         << images->num_cameras - images->num_known_focal_lengths;
  }
  message_(text.str());
  if (!images->unreadable.empty()) {
    Warn({"not images: " + std::to_string(images->unreadable.size()) + " of " +
          std::to_string(names.size()) + " files (the first one is " +
          images->unreadable.front() + ")"});
  }
  const ProgressCallback extraction_progress =
      [&progress](const std::string& what, double share_done) {
        progress(what, 0.1 + 0.9 * share_done);
      };
  if (options_.features.extractor == "opencv") {
    SiftFeatureOptions sift;
    sift.max_image_size = options_.features.max_image_size;
    sift.max_num_features = options_.features.max_num_features;
    return ExtractSiftOfDatabase(sift, options_.features.num_threads,
                                 paths_.image_path, database_path_,
                                 extraction_progress);
  }
  return ExtractFeatures(options_.features, paths_.image_path, database_path_,
                         InWorkspace("logs/features.log"), extraction_progress);
}

Status Reconstructor::Features() {
  // The workspace may lie among the photos, or the photos of a bag in it.
  const StatusOr<std::vector<std::string>> names = ListFilesRecursively(
      paths_.image_path, HasRecording() ? "" : paths_.workspace_path);
  if (!names.ok()) return names.status();
  if (names->empty()) {
    return Status::Error("the folder " + paths_.image_path +
                         " has no files; check --image_path");
  }
  const FeatureOptions& features = options_.features;
  const StepInputs inputs = {
      {"photos", DigestFiles(paths_.image_path, *names)},
      {"camera_model", features.camera_model},
      {"camera_params", features.camera_params},
      {"single_camera", std::to_string(features.single_camera)},
      {"max_image_size", std::to_string(features.max_image_size)},
      {"max_num_features", std::to_string(features.max_num_features)},
      {"extractor", features.extractor},
      {"first_octave", std::to_string(features.first_octave)}};
  return RunStep("features", inputs,
                 {[this] { return ResetFeatures(paths_.workspace_path); },
                  [&] { return ExtractAll(*names); },
                  [this] { return CheckFeatures(database_path_); }});
}

Status Reconstructor::Matching() {
  const PairSelectionOptions& pairs = options_.pairs;
  // The odometry has a say in the pairs.
  StatusOr<StepInputs> inputs = DigestSensors();
  if (!inputs.ok()) return inputs.status();
  const StatusOr<StepInputs> descriptors =
      DigestPaths({{"descriptors", pairs.descriptors_path}});
  if (!descriptors.ok()) return descriptors.status();
  inputs.value().insert(descriptors->begin(), descriptors->end());
  inputs.value()["num_temporal_neighbors"] =
      std::to_string(pairs.num_temporal_neighbors);
  inputs.value()["num_similar_images"] =
      std::to_string(pairs.num_similar_images);
  inputs.value()["matcher"] = options_.features.matcher;
  inputs.value()["guided_matching"] = std::to_string(options_.guided_matching);
  const auto reset = [this] {
    const Status status = ResetMatches(database_path_);
    return status.ok() ? ResetPriors(database_path_) : status;
  };
  const auto work = [&]() -> Status {
    const ProgressCallback progress = ProgressIn(kMatching, "matching");
    const Status imported = ImportForPairs(progress);
    if (!imported.ok()) return imported;
    const StatusOr<PairSelection> selection =
        SelectPairs(pairs, database_path_,
                    [&progress](const std::string& what, double share_done) {
                      progress(what, 0.05 * share_done);
                    });
    if (!selection.ok()) return selection.status();
    Warn(selection->warnings);
    message_("matching: " + std::to_string(selection->num_temporal) +
             " pairs of neighbours in time, " +
             std::to_string(selection->num_predicted) + " by the odometry, " +
             std::to_string(selection->num_similar) +
             " more of similar images");
    return MatchSelected(selection->pairs, progress);
  };
  return RunStep("matching", *inputs, {reset, work, &KeepAll});
}

Status Reconstructor::MatchSelected(const std::vector<ImagePair>& pairs,
                                    const ProgressCallback& progress) {
  MotionPredictor predictor;
  if (options_.guided_matching) {
    StatusOr<MotionPredictor> read = ReadMotionPredictor(database_path_);
    if (!read.ok()) return read.status();
    predictor = std::move(read).value();
  }
  int num_guided = 0;
  const Status status = MatchPairs(
      options_.features, pairs, database_path_,
      InWorkspace("logs/matching.log"),
      [&progress](const std::string& what, double share_done) {
        progress(what, 0.05 + 0.95 * share_done);
      },
      predictor, &num_guided);
  if (!status.ok()) return status;
  if (num_guided > 0) {
    message_("matching: " + std::to_string(num_guided) + " of " +
             std::to_string(pairs.size()) + " pairs along their predicted " +
             "epipolar lines");
  }
  return CheckMatches(database_path_, pairs);
}

Status Reconstructor::ImportForPairs(const ProgressCallback& progress) const {
  if (!HasMotionLogs()) return Status::Ok();
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path_);
  if (!tables.ok() || !tables->tables.priors.empty()) return tables.status();
  progress("reading the logs", 0.0);
  return Import().status();
}

StatusOr<PriorImport> Reconstructor::Import() const {
  PriorImportPaths paths;
  paths.database_path = database_path_;
  paths.image_times_path = paths_.image_times_path;
  paths.imu_path = paths_.imu_path;
  paths.wheel_path = paths_.wheel_path;
  paths.gnss_path = paths_.gnss_path;
  paths.sensors_path = paths_.sensors_path;
  return ImportPriors(options_.priors, paths, database_path_ + ".priors.json");
}

StatusOr<StepInputs> Reconstructor::DigestSensors() const {
  // "database" is no file.
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
    const StatusOr<PriorImport> import = Import();
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

}  // namespace

bool AutomaticReconstructionOptions::IsValid(std::string* error) const {
  if (refine_intrinsics < -1 || refine_intrinsics > 1) {
    *error = "refine_intrinsics = " + std::to_string(refine_intrinsics) +
             " must be -1, 0 or 1";
    return false;
  }
  return bag.photos.IsValid(error) && features.IsValid(error) &&
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
