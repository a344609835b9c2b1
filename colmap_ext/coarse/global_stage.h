// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/scene/calibrate_focal_lengths.h"
#include "colmap_ext/scene/raw_matches.h"
#include "colmap_ext/scene/scene_data.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/inertial_motion.h"
#include "core/status.h"
#include "global/estimate_coarse_poses.h"
#include "global/structure/match_refinement.h"

namespace adasfm {

// Nested by step, in order of their use.
struct GlobalStageOptions {
  FocalLengthCalibrationOptions focal_lengths;
  TwoViewPoseOptions two_view;
  CoarsePoseOptions poses;
  CoarseStructureOptions structure;
  MatchRefinementOptions refinement;
  // Whether the coarse positions and the directions of gravity go into the
  // table pose_priors of COLMAP 4, for its own mappers.
  bool write_pose_priors = false;
  // 1 sigma of a coarse position there, in m or the model's unit: what coarse
  // models of drives err by.
  double pose_prior_sigma = 0.5;
  // In GB (1e9 bytes); -1: no bound. EstimateCoarseModel does not begin what
  // is estimated to take more.
  double max_memory_gb = -1.0;
  // Of all steps but structure.bundle; -1: all of the machine's.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct GlobalStageResult {
  // Those that were changed in the scene.
  std::vector<CalibratedFocalLength> focal_lengths;
  // One per component of the view graph, largest first.
  std::vector<CoarseModel> models;
  // What EstimateCoarsePoses says of each component, in the same order, and its
  // view graph with the reasons of removal.
  CoarsePoses poses;
  MatchRefinementReport refinement;
  // The new two-view geometries, and the pairs that have none any more: they
  // lost their matches, or the view graph refuted them. Pairs of images without
  // pose are in neither. Both empty without match refinement.
  std::vector<NewTwoViewGeometry> geometries;
  std::vector<ImagePair> removed_pairs;
  // Of priors that know none, in models that have metres by the accelerometer.
  std::vector<InertialLength> inertial_lengths;
  // BridgeGaps: of translations across gaps that had part in the poses.
  std::map<ImagePair, Eigen::Matrix3d> bridges;
  std::vector<CoarseStep> steps;
};

// Whether an odometry that leads across gaps between models (BridgeGaps) did
// good: the largest model has more images, and vision's pairs bear it out.
bool IsBetterAcrossGaps(const GlobalStageResult& in_parts,
                        const GlobalStageResult& across);

// Called when a step begins, with its name and the share of steps that are
// done.
using StageProgress = std::function<void(const std::string&, double)>;

// The coarse global stage in memory (adasfm_pipeline.h):
//   2.0      unknown focal lengths       CalibrateFocalLengths, in the scene
//   2.1      view graph                  BuildInitialViewGraph
//   2.1-2.6  coarse poses                EstimateCoarsePoses
//   2.7      tracks, points, adjustment  BuildCoarseModel, per component
//            parts that nothing ties     SplitModels, JoinModels
//            gaps, then 2.1 to 2.7 anew  BridgeGaps
//   2.8      match refinement            RefineMatches
//   2.9      metres without wheels       MeasureSize, per component
// The scene is read with original two-view geometries; raw matches, those of
// the scene if there is no other source, are asked for while the stage works.
// An error when the scene has no two images that hold together. Throws
// std::invalid_argument for invalid options.
StatusOr<GlobalStageResult> RunGlobalStage(const GlobalStageOptions& options,
                                           SceneData* scene,
                                           const StageProgress& progress = {},
                                           RawMatchSource raw_matches = {});

}  // namespace adasfm
