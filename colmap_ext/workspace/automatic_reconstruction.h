// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/bags/extract_bag.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/io/run_manifest.h"
#include "colmap_ext/pairs/select_pairs.h"
#include "core/progress.h"
#include "core/status.h"

namespace adasfm {

struct AutomaticReconstructionOptions {
  // Options of the extraction from a bag; has_calibration and wheel_type are
  // set from the paths.
  BagExtractionOptions bag;
  // A video's time 0 on the clock of the logs [ns]. bag.photos selects the
  // frames of a video, too.
  timestamp_t video_start_ns = 0;
  FeatureOptions features;
  PairSelectionOptions pairs;
  // Where priors predict the motion between two images, compare only keypoints
  // near their epipolar lines (host/v3/match_sift_pairs.h).
  bool guided_matching = false;
  PriorImportOptions priors;
  GlobalStageOptions global;
  MapOptions map;
  // Whether the model adjusts focal length and distortion: 0, 1, or -1 for
  // cameras without features.camera_params. If so, the coarse stage does not
  // refine the matches.
  int refine_intrinsics = -1;
  // Removes the results of earlier calls in the workspace and starts again.
  bool restart = false;
  // Bound for import, coarse model and mapper each, in GB (1e9 bytes); -1: the
  // default of each stage.
  double max_memory_gb = -1.0;
  // Threads of all stages; -1: all of the machine.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// Empty paths: there is no such file.
struct AutomaticReconstructionPaths {
  // A recording in place of image_path, which provides all paths and the camera
  // that are not given (sensors/bags/bag_reader.h).
  std::string bag_path;
  // A video in place of image_path (bags/extract_video.h), for photos and
  // times.
  std::string video_path;
  std::string image_path;
  std::string workspace_path;
  // euroc, 4seasons, kitti or tum: image_path is the root folder of such a
  // recording, which provides what is not given here (dataset_layout.h).
  std::string data_format;
  std::string image_times_path;
  std::string imu_path;
  std::string wheel_path;
  std::string gnss_path;
  std::string sensors_path;
  std::string ground_truth_path;
};

struct AutomaticReconstructionResult {
  struct Step {
    std::string name;
    double seconds = 0.0;  // of the run that did it, this or an earlier one
  };
  std::vector<Step> steps;
  std::string model_path;
  std::string report_path;
  // Verdict on the model, by this call or an earlier one: one line, and whether
  // it says that the model failed.
  std::string verdict;
  bool has_failed = false;
};

// From a folder of photos, and sensor logs where there are any, to the model
// and its report, in the workspace:
//   0  bag        photos, logs, calibration of a bag   bag/
//                 (or photos of a video)
//   1  features   cameras, keypoints, descriptors      database.db
//   2  matching   pair selection, matches, geometries  database.db
//   3  priors     sensor logs                          database.db
//   4  coarse     coarse global SfM                    coarse/
//   5  model      partitioned mapping                  sparse/0
//   6  report     one page to look at                  report.html
// Pairs are matched as soon as their features are available (early_matcher.h).
// steps.json records which steps are done, with their inputs: the same call
// again does what is missing; a call with other options starts at the first
// step that they affect. An interruption (core/interruption.h) by `progress`
// keeps finished work. An error when the workspace has a database that this
// function did not create. Throws std::invalid_argument for invalid options.
StatusOr<AutomaticReconstructionResult> ReconstructAutomatically(
    const AutomaticReconstructionOptions& options,
    const AutomaticReconstructionPaths& paths, const ProgressCallback& progress,
    const MessageCallback& message);

}  // namespace adasfm
