// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/evaluation/relative_pose_auc.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// The true landmark of each keypoint, by image name; -1: none.
using KeypointLandmarks = std::map<std::string, std::vector<int>>;

// Lines `image_name id id ...`, one id per keypoint, as adasfm_synthesizer
// writes them to landmarks.txt. The error names file and line.
StatusOr<KeypointLandmarks> ReadKeypointLandmarks(const std::string& path);

// Figures of a set of two-view geometries compared with the truth.
struct PairSetFigures {
  static constexpr int kNumBins = 20;

  int num_pairs = 0;
  std::vector<RelativePoseAuc> auc;
  // Number of pairs by their ratio of inliers to raw matches: bin k starts at
  // k/20. Pairs without raw matches are in no bin.
  std::array<int, kNumBins> inlier_ratio_histogram = {};
  double mean_inlier_ratio = 0.0;
  int64_t num_matches = 0;
  // With landmarks: matches whose keypoints see the same landmark, and pairs
  // with fewer true than wrong matches.
  int64_t num_true_matches = 0;
  int num_false_pairs = 0;
};

struct PairEvaluation {
  bool has_landmarks = false;
  // True matches among the raw matches of the verified pairs: the maximum that
  // can be found.
  int64_t num_true_raw_matches = 0;
  // All pairs as COLMAP verified them (the paper's NN+RANSAC).
  PairSetFigures verified;
  // The pairs that adasfm_global kept, before and after it.
  PairSetFigures kept_before;
  PairSetFigures kept_after;
};

// Compares pairs of images with true poses, before and after adasfm_global;
// both are the same when it has not rewritten the database. landmarks may be
// empty. original, present: the scene of one database, read with and without
// use_original_two_view_geometries; original needs raw matches.
StatusOr<PairEvaluation> EvaluatePairs(const SceneData& original,
                                       const SceneData& present,
                                       const NamedPoses& true_cams_from_world,
                                       const KeypointLandmarks& landmarks);

// Reads the database with both options and compares. landmarks_path may be
// empty.
StatusOr<PairEvaluation> EvaluateDatabasePairs(
    const std::string& database_path, const NamedPoses& true_cams_from_world,
    const std::string& landmarks_path);

std::string FormatPairEvaluation(const PairEvaluation& evaluation);
std::string PairEvaluationToJson(const PairEvaluation& evaluation);

}  // namespace adasfm
