// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "global/calibration/correct_camera_imu_rotation.h"
#include "global/loop_closures/filter_loop_closures.h"
#include "global/loop_closures/loop_closure_options.h"
#include "global/odometry/augment_view_graph.h"
#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/visual_odometry.h"
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
  CameraImuRotationOptions camera_imu_rotation;
  RelativePoseRefinementOptions relative_poses;
  // Visual odometry, for the consistency check of loop closures, where sensors
  // do not measure a motion.
  bool use_visual_odometry = true;
  LoopClosureOptions loops;
  RotationAveragingOptions rotations;
  // eps_R.
  double max_rotation_discrepancy_deg = 5.0;
  RelativeTranslationOptions translations;
  AugmentationOptions augmentation;
  TranslationAveragingOptions positions;
  // Edges with fewer inliers take no part.
  int min_num_inliers = 15;
  // Threads of all steps; -1: all of the machine.
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
  // Closures that may be perceptual aliasing; none with odometry throughout.
  std::vector<SegmentClosure> unconfirmed_closures;
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
  // The input's, by drive, rotated where vision corrected T_cam_imu.
  std::vector<RelativePosePrior> priors;
  CameraImuRotationReports camera_imu_rotations;
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
//       the camera-IMU rotation                 CorrectCameraImuRotation
//   2.2 odometry chain, lengths, loop closures  AddVisualOdometry
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
