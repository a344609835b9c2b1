// SPDX-License-Identifier: BSD-3-Clause
#include <sstream>
#include <string>
#include <utility>

#include "colmap_ext/features/extract_sift.h"
#include "colmap_ext/host/host_features.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/pairs/predict_motions.h"
#include "colmap_ext/workspace/early_database.h"
#include "colmap_ext/workspace/early_matcher.h"
#include "colmap_ext/workspace/reconstructor.h"
#include "colmap_ext/workspace/reset_workspace.h"

namespace adasfm {
namespace {

std::string TextOf(const StepInputs& inputs) {
  std::string text;
  for (const auto& [name, value] : inputs) text += name + "=" + value + "\n";
  return text;
}

}  // namespace

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
  } else {
    text << ", calibrated as " << options_.features.camera_model;
  }
  message_(text.str());
  if (!images->unreadable.empty()) {
    Warn({"not images: " + std::to_string(images->unreadable.size()) + " of " +
          std::to_string(names.size()) + " files (the first one is " +
          images->unreadable.front() + ")"});
  }
  return ExtractRegistered(
      [&progress](const std::string& what, double share_done) {
        progress(what, 0.1 + 0.9 * share_done);
      });
}

bool Reconstructor::CanMatchEarly() const {
  // A given number of threads forbids using the rest of the machine. Extraction
  // already occupies a single GPU, and the host's internal matcher prints on
  // std::cout, as the extraction does.
  const FeatureOptions& features = options_.features;
  const bool matches_here = !UsesGpu(features) && features.matcher == "adasfm";
  return options_.num_threads == -1 && (UsesHostProgram() || matches_here);
}

Status Reconstructor::ExtractRegistered(const ProgressCallback& progress) {
  const FeatureOptions& features = options_.features;
  const StatusOr<StepInputs> inputs = MatchingInputs();
  if (!inputs.ok()) return inputs.status();
  EarlyMatchingRequest request;
  request.features = features;
  request.pairs = options_.pairs;
  request.guided_matching = options_.guided_matching;
  request.database_path = database_path_;
  request.early_path = EarlyDatabasePath(paths_.workspace_path);
  request.inputs = TextOf(*inputs);
  request.log_path = InWorkspace("logs/matching.log");
  request.import_priors = [this](const std::string& path) {
    return ImportForPairs(path);
  };
  EarlyMatcher matcher(std::move(request));
  const bool can_match_early = CanMatchEarly();
  double first_share = -1.0;
  const ProgressCallback extraction_progress = [&](const std::string& what,
                                                   double share_done) {
    if (first_share < 0.0) first_share = share_done;
    if (can_match_early && share_done > first_share) matcher.Start();
    progress(what, share_done);
  };
  Status status;
  if (features.extractor == "opencv") {
    SiftFeatureOptions sift;
    sift.max_image_size = features.max_image_size;
    sift.max_num_features = features.max_num_features;
    status =
        ExtractSiftOfDatabase(sift, features.num_threads, paths_.image_path,
                              database_path_, extraction_progress);
  } else {
    status =
        ExtractFeatures(features, paths_.image_path, database_path_,
                        InWorkspace("logs/features.log"), extraction_progress);
  }
  if (!status.ok()) return status;
  matcher.Finish();
  num_guided_early_ = matcher.NumGuided();
  return Status::Ok();
}

Status Reconstructor::Features() {
  // The workspace may be inside the folder of photos, or a bag's photos inside
  // it.
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

StatusOr<StepInputs> Reconstructor::MatchingInputs() const {
  const PairSelectionOptions& pairs = options_.pairs;
  // The odometry affects the selection of pairs.
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
  return inputs;
}

Status Reconstructor::Matching() {
  const StatusOr<StepInputs> inputs = MatchingInputs();
  if (!inputs.ok()) return inputs.status();
  const auto reset = [this] {
    const Status status = ResetMatches(database_path_);
    return status.ok() ? ResetPriors(database_path_) : status;
  };
  const auto work = [&]() -> Status {
    const ProgressCallback progress = ProgressIn(kMatching, "matching");
    if (HasMotionLogs()) progress("reading the logs", 0.0);
    const Status imported = ImportForPairs(database_path_);
    if (!imported.ok()) return imported;
    const StatusOr<int> num_early =
        TakeEarlyMatches(EarlyDatabasePath(paths_.workspace_path),
                         TextOf(*inputs), database_path_);
    if (!num_early.ok()) return num_early.status();
    const StatusOr<PairSelection> selection =
        SelectPairs(options_.pairs, database_path_,
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
    if (*num_early > 0) {
      message_("matching: " + std::to_string(*num_early) +
               " of them are matched, while features were extracted");
    }
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
  num_guided += num_guided_early_;
  if (num_guided > 0) {
    message_("matching: " + std::to_string(num_guided) + " of " +
             std::to_string(pairs.size()) + " pairs along their predicted " +
             "epipolar lines");
  }
  return CheckMatches(database_path_, pairs);
}

}  // namespace adasfm
