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
  // Whether the world's unit is the metre: the scale then stays 1.
  bool is_metric = false;
  // The unit vector towards the ground, in the world.
  std::optional<Eigen::Vector3d> down_in_world;
};

struct PositionAlignment {
  bool success = false;
  std::string failure;  // why not, a sentence without its end
  // The world moved into the frame of the positions.
  Sim3d enu_from_world;
  // Positions of images that have a pose.
  int num_positions = 0;
  // Those no further off than the threshold that most of them fit.
  int num_inliers = 0;
  // The threshold, in sigmas of the median position: at least that of a normal
  // error, more where the world is bent.
  double threshold_sigmas = 0.0;
};

// The similarity between a model and the positions of its antenna, with up to
// 40 % of them wrong in any way (jumps, reflections).
//   1. Hypotheses from two positions and the vertical (four degrees of freedom
//      and the scale), and where the vertical is not known from three: photos
//      are taken upright as a rule, so the mean of the cameras' y axes stands
//      in for it.
//   2. The hypothesis with the least truncated squared error, at the smallest
//      of a few thresholds that 60 % of the positions fit.
//   3. Gauss-Newton on all seven degrees of freedom with Tukey's loss, where
//      the vertical is one more observation.
// Fails with fewer than three positions, without a hypothesis that most of them
// fit, and when the heading (5 deg) or the scale (10 %) stays uncertain.
PositionAlignment AlignToPositions(const PositionAlignmentInput& input);

// 1 sigma of one direction of a position, the mean over directions.
double PositionSigma(const PositionPrior& prior);

}  // namespace adasfm
