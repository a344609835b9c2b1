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

// What all pairs share: the turn of the camera's mount, that of the direction
// of driving against it (both rad), the gyroscope's bias (rad/s) and vision's
// own offset in the later camera (rad), three numbers each. The first two look
// the same in the direction of a motion.
constexpr int kNumMountUnknowns = 12;
constexpr int kDrivingDirectionUnknown = 3;
constexpr int kRateUnknown = 6;

// One pair's rotation or direction, whitened: residual = jacobian * unknowns.
// Rows that a term does not have are zero.
struct MountObservation {
  Eigen::Matrix<double, 3, kNumMountUnknowns> jacobian;
  Eigen::Vector3d residual;
  int num_dof = 3;
  // Pairs of many steps overlap with as many others.
  double weight = 1.0;
  // Those of one span of the drive share their errors.
  int span = 0;
};

// A pair that the chain predicts, the earlier image first.
struct MountPair {
  image_t first = kInvalidImageId;
  image_t last = kInvalidImageId;
  Eigen::Quaterniond last_from_first;  // by vision
  double rotation_sigma_rad = 0.0;
  double seconds = 0.0;
  int num_steps = 0;
  int span = 0;
  EdgeBearings bearings;
};

// The pairs that tell the mount: with matches, and at most so many steps of the
// chain apart. Of very many an even subset.
std::vector<MountPair> CollectMountPairs(
    int max_num_steps, const OdometryChain& chain, const ViewGraph& graph,
    const GlobalCorrespondences& correspondences,
    const std::vector<RelativePosePrior>& priors);

// What the pair says with its priors turned by `turn`: the rotation, and the
// direction of motion where sensors have one. Empty where matches and sensors
// have nothing in common.
std::vector<MountObservation> ObserveMount(const OdometryChain& chain,
                                           const Eigen::Quaterniond& turn,
                                           const MountPair& pair);

}  // namespace adasfm
