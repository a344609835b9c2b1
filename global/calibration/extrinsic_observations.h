// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/epipolar.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// Unknowns that all pairs share, three numbers each: the error of the
// camera-IMU rotation, the error of the direction of driving relative to it
// (both rad), the gyroscope's bias (rad/s), its scales about the camera's axes
// (relative; shared_errors.h) and the offset of visual rotations in the later
// camera (rad). A direction of motion cannot separate the first two.
constexpr int kNumExtrinsicUnknowns = 15;
constexpr int kDrivingDirectionUnknown = 3;
constexpr int kRateUnknown = 6;
constexpr int kScaleUnknown = 9;
// Pairs at most this many steps of the chain apart are used.
inline constexpr int kMaxNumExtrinsicSteps = 10;

// One pair's rotation or direction, whitened: residual = jacobian * unknowns.
// Rows that a term does not have are zero.
struct ExtrinsicObservation {
  Eigen::Matrix<double, 3, kNumExtrinsicUnknowns> jacobian;
  Eigen::Vector3d residual;
  int num_dof = 3;
  // Pairs of many steps overlap with as many other pairs.
  double weight = 1.0;
  // Observations of one span of the drive share their errors.
  int span = 0;
};

// A pair that the chain predicts, the earlier image first.
struct ExtrinsicPair {
  image_t first = kInvalidImageId;
  image_t last = kInvalidImageId;
  Eigen::Quaterniond last_from_first;  // by vision
  double rotation_sigma_rad = 0.0;
  double seconds = 0.0;
  int num_steps = 0;
  int span = 0;
  EdgeBearings bearings;
};

// The pairs that observe the camera-IMU rotation: pairs with matches, at most
// kMaxNumExtrinsicSteps steps of the chain apart. Of very many pairs, an even
// subset.
std::vector<ExtrinsicPair> CollectExtrinsicPairs(
    const OdometryChain& chain, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences,
    const std::vector<RelativePosePrior>& priors);

// Observations of the pair with its priors rotated by `turn`: its rotation, and
// its direction of motion where the sensors have one and the matches determine
// a similar one.
std::vector<ExtrinsicObservation> ObserveExtrinsics(
    const OdometryChain& chain, const Eigen::Quaterniond& turn,
    const ExtrinsicPair& pair);

}  // namespace adasfm
