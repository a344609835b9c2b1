// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/step_journal.h"
#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/progress.h"
#include "core/status.h"

namespace adasfm {

// Steps whose files are replaced have nothing to remove beforehand.
inline Status KeepAll() { return Status::Ok(); }

// The steps of ReconstructAutomatically (automatic_reconstruction.h), each of
// which the journal of the workspace does once. The recording's, the features'
// and matches', and the priors' stand in files of their own (reconstruct_*.cc).
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
                 const StepJournal::StepActions& actions);

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
  // Matches what it can while they are extracted.
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
  // Before the matching, without the photos' rotations: for the choice of
  // pairs, and so that faults of the logs are known before the long work. A run
  // that goes on takes what is there, so that it chooses the same pairs.
  Status ImportForPairs(const std::string& database_path) const;
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
  // Of the pairs matched while features were extracted.
  int num_guided_early_ = 0;
  AutomaticReconstructionResult result_;
};

}  // namespace adasfm
