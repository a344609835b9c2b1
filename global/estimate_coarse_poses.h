// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "global/calibration/correct_camera_mount.h"
#include "global/loop_closures/filter_loop_closures.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/augment_view_graph.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/visual_steps.h"
#include "global/rotation_averaging/rotation_averaging.h"
#include "global/translation_averaging/filter_edges_by_position.h"
#include "global/translation_averaging/translation_averaging.h"
#include "global/two_view/refine_relative_poses.h"
#include "global/two_view/relative_translation.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Nested by step, in order of their use.
struct CoarsePoseOptions {
  OdometryChainOptions chain;
  CameraMountOptions camera_mount;
  RelativePoseRefinementOptions relative_poses;
  EdgeLengthOptions lengths;
  VisualStepOptions visual_steps;
  LoopClosureOptions loops;
  // Without priors, parts of a drive are kept apart only where the visual chain
  // holds this share of the images that share a pair.
  double min_sequence_ratio = 0.8;
  RotationAveragingOptions rotations;
  // eps_R.
  double max_rotation_discrepancy_deg = 5.0;
  RelativeTranslationOptions translations;
  AugmentationOptions augmentation;
  TranslationAveragingOptions positions;
  PositionFilterOptions position_filter;
  // Least error granted to the odometry's rotation between two cameras (their
  // calibration, rolling shutter), added to its covariance.
  double min_predicted_rotation_sigma_deg = 0.05;
  // Rounds of relative poses and rotation averaging for pairs that odometry
  // does not predict: each takes the global rotations of the last as prediction
  // with this sigma.
  int num_rotation_rounds = 2;
  double global_rotation_sigma_deg = 1.0;
  // Edges with fewer inliers take no part.
  int min_num_inliers = 15;
  // Priors shorter than this (standstill) say nothing about depths.
  double min_known_length_m = 0.05;
  // Of all steps; -1: all of the machine's.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

// The poses of one component.
struct CoarseComponent {
  std::map<image_t, Rigid3d> cams_from_world;
  // In metres.
  bool metric = false;
  bool rotations_converged = false;
  bool positions_converged = false;
  double sdp_optimality = 0.0;
  // Where nothing tells look-alike places apart; none with odometry throughout.
  std::vector<UnconfirmedClosure> unconfirmed_closures;
};

struct CoarseStep {
  std::string name;
  double seconds = 0.0;
  // What it did, in one line: "removed 238 of 5141 edges".
  std::string summary;
};

struct CoarsePoses {
  // Largest first; at least two images each. Empty when no edge is useful.
  std::vector<CoarseComponent> components;
  // The input's edges and those added, with reasons of removal and the
  // relative poses as they were used.
  ViewGraph graph;
  // The input's, turned by the camera's mount where vision corrected it.
  std::vector<RelativePosePrior> priors;
  CameraMountReport camera_mount;
  LoopClosureReport loop_closures;
  std::vector<CoarseStep> steps;
};

// Steps 2.1 to 2.6 of the coarse stage (adasfm_pipeline.h), from an initial
// view graph (relative poses of verified pairs) to camera poses. Priors may be
// empty. frame_priors are those between the cameras of a rig
// (ComputeFramePriors); they take part wherever priors do, and the odometry of
// a frame's leader is that of its other images. Throws std::invalid_argument
// for invalid options or an inconsistent graph. Numbered steps:
//   2.1 least-squares relative poses            RefineRelativePoses
//       the camera's mount                      CorrectCameraMount
//   2.2 odometry chain, lengths, loop closures  AddVisualSteps
//                                               FilterLoopClosures
//   2.3 sensor edges, rotation averaging        EstimateGlobalRotations
//   2.4 edges off the rotations                 FilterEdgesByRotation
//   2.5 directions, sensor translations         EstimateRelativeTranslations
//   2.6 positions, edges off the positions      EstimateGlobalPositions
CoarsePoses EstimateCoarsePoses(
    const CoarsePoseOptions& options, const ViewGraph& initial_graph,
    const GlobalCorrespondences& correspondences,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<RelativePosePrior>& frame_priors = {});

}  // namespace adasfm
