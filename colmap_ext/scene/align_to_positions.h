// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/position_prior.h"
#include "core/rigid3d.h"
#include "core/sim3d.h"
#include "core/types.h"

namespace adasfm {

struct PositionAlignmentInput {
  std::vector<PositionPrior> positions;
  std::map<image_t, Rigid3d> cams_from_world;
  // Whether the world's unit is the metre; the scale is then fixed to 1.
  bool is_metric = false;
  // Unit vector towards the ground, in the world frame.
  std::optional<Eigen::Vector3d> down_in_world;
};

struct PositionAlignment {
  bool success = false;
  std::string failure;  // the reason, a sentence without its end
  // Transforms the world into the frame of the positions.
  Sim3d enu_from_world;
  // Number of positions whose images have a pose.
  int num_positions = 0;
  // Number of positions whose residual is within the threshold.
  int num_inliers = 0;
  // The threshold, in sigmas of the median position: at least that of a normal
  // error, larger where the model is deformed.
  double threshold_sigmas = 0.0;
};

// Estimates the similarity between a model and the positions of its antenna. Up
// to 40 % of the positions may be wrong in any way (jumps, reflections).
//   1. Hypotheses from two positions and the vertical (four degrees of freedom
//      and the scale). Without a known vertical, the mean of the cameras' y
//      axes replaces it, as photos are usually taken upright, and hypotheses
//      from three positions are added.
//   2. The hypothesis with the least truncated squared error, at the smallest
//      of a few thresholds that 60 % of the positions fit.
//   3. Gauss-Newton on all seven degrees of freedom with Tukey's loss, with the
//      vertical as one more observation.
// Fails with fewer than three positions, when no hypothesis fits 60 % of the
// positions, and when the heading (5 deg) or the scale (10 %) stays uncertain.
PositionAlignment AlignToPositions(const PositionAlignmentInput& input);

// 1 sigma of a position in one direction, the mean over directions.
double PositionSigma(const PositionPrior& prior);

}  // namespace adasfm
