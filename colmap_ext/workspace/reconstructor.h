// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/run_manifest.h"
#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/progress.h"
#include "core/status.h"

namespace adasfm {

// For steps that replace their files and so have nothing to remove beforehand.
inline Status KeepAll() { return Status::Ok(); }

// The steps of ReconstructAutomatically (automatic_reconstruction.h). The
// workspace's manifest runs each step once. The steps of recording, features
// and matches, and priors are in their own files (reconstruct_*.cc).
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

  StatusOr<AutomaticReconstructionResult> Run();

 private:
  // The steps' intervals of the total progress; with features on the CPU,
  // matching takes most of the time.
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
                 const RunManifest::StepActions& actions);

  Status Prepare();
  // Whether photos are extracted from a bag or video first.
  bool HasRecording() const {
    return !paths_.bag_path.empty() || !paths_.video_path.empty();
  }
  Status Bag();
  Status Video();
  // Runs the step that extracts photos from a bag or video.
  Status RunExtraction(
      const StepInputs& inputs,
      const std::function<StatusOr<BagExtraction>(const std::string&)>&
          extract);
  Status Features();
  Status ExtractAll(const std::vector<std::string>& names);
  // Extracts features and matches pairs at the same time where possible.
  Status ExtractRegistered(const ProgressCallback& progress);
  bool CanMatchEarly() const;
  StatusOr<StepInputs> MatchingInputs() const;
  Status Matching();
  Status MatchSelected(const std::vector<ImagePair>& pairs,
                       const ProgressCallback& progress);
  Status Priors();
  bool HasMotionLogs() const {
    return !paths_.imu_path.empty() || !paths_.wheel_path.empty();
  }
  StatusOr<StepInputs> DigestSensors() const;
  StatusOr<PriorImport> Import(const std::string& database_path) const;
  // Imports before the matching, without two-view rotations: for the selection
  // of pairs, and to find faults of the logs before the long work. A continued
  // run keeps existing priors, so that it selects the same pairs.
  Status ImportForPairs(const std::string& database_path) const;
  Status Coarse();
  Status Model();
  Status Report();
  Status ReadVerdict();
  // Checks a model and its summary in a folder of the workspace.
  Status CheckResult(const std::string& folder) const;

  AutomaticReconstructionOptions options_;
  AutomaticReconstructionPaths paths_;
  const ProgressCallback& progress_;
  const MessageCallback& message_;
  std::string database_path_;
  std::shared_ptr<FolderLock> lock_;
  RunManifest manifest_;
  // Guided pairs that were matched while features were extracted.
  int num_guided_early_ = 0;
  AutomaticReconstructionResult result_;
};

}  // namespace adasfm
