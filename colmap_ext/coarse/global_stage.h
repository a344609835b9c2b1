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
#include "colmap_ext/scene/drives.h"
#include "colmap_ext/scene/raw_matches.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/inertial_motion.h"
#include "core/status.h"
#include "global/estimate_coarse_poses.h"
#include "global/structure/match_refinement.h"

namespace adasfm {

// Nested by step, in order of their use.
struct GlobalStageOptions {
  FocalLengthCalibrationOptions focal_lengths;
  CoarsePoseOptions poses;
  CoarseStructureOptions structure;
  MatchRefinementOptions refinement;
  // Whether the coarse positions and the directions of gravity go into the
  // table pose_priors of COLMAP 4, for its own mappers.
  bool write_pose_priors = false;
  // 1 sigma of a coarse position there, in m or the model's unit: the typical
  // error of coarse models of drives.
  double pose_prior_sigma = 0.5;
  // Memory in GB (1e9 bytes); -1: no bound. EstimateCoarseModel returns an
  // error where its estimate exceeds this.
  double max_memory_gb = -1.0;
  // Threads of all steps but structure.bundle; -1: all of the machine's.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct GlobalStageResult {
  // The focal lengths that were changed in the scene.
  std::vector<CalibratedFocalLength> focal_lengths;
  // One per component of the view graph, largest first.
  std::vector<CoarseModel> models;
  // Result of EstimateCoarsePoses for each component, in the same order, and
  // the view graph with the reasons of removal.
  CoarsePoses poses;
  MatchRefinementReport refinement;
  // The new two-view geometries, and the pairs that have none any more: they
  // lost their matches, or the view graph rejected them. Pairs of images
  // without pose are in neither. Both empty without match refinement.
  std::vector<NewTwoViewGeometry> geometries;
  std::vector<ImagePair> removed_pairs;
  // Lengths for priors without one, in models with metres by accelerometer.
  std::vector<InertialLength> inertial_lengths;
  // What timeshift_cam_imu lacks, where the coarse models show it; the scene's
  // priors and inertial motions are corrected by it.
  TimeShiftMap time_shifts;
  // Of the gyroscopes, likewise; the priors are corrected by them.
  GyroscopeScaleMap gyroscope_scales;
  // Covariances of translations across gaps (BridgeGaps), where poses use them.
  std::map<ImagePair, Eigen::Matrix3d> bridges;
  std::vector<CoarseStep> steps;
};

// Whether odometry across the gaps between models (BridgeGaps) was an
// improvement: the largest model has more images, and visual pairs confirm it.
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
//            clocks of the cameras       FindTimeShifts
//            scales of the gyroscopes    FindGyroscopeScales
//            gaps, then 2.1 to 2.7 anew  BridgeGaps
//   2.8      match refinement            RefineMatches
//   2.9      metres without wheels       MeasureSize, per component
// The scene must be read with its original two-view geometries. Raw matches are
// requested while the stage works; without a source they are the scene's. An
// error when no two images of the scene are connected. Where T_cam_imu was
// corrected, the scene's gravity and inertial motions are rotated. Throws
// std::invalid_argument for invalid options.
StatusOr<GlobalStageResult> RunGlobalStage(const GlobalStageOptions& options,
                                           SceneData* scene,
                                           const StageProgress& progress = {},
                                           RawMatchSource raw_matches = {});

}  // namespace adasfm
