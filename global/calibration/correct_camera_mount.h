// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct CameraMountOptions {
  bool enabled = true;
  // Pairs at most this many steps of the chain apart tell the mount.
  int max_num_steps = 10;
  // 1 sigma of what a calibration may be wrong by, per axis. Keeps what a drive
  // does not tell (the roll of a straight one) at zero.
  double sigma_deg = 5.0;
  // Least error granted to what pairs say of it, per axis: the principal point
  // and the wheels' axis of a good calibration are off by as much.
  double min_sigma_deg = 0.05;
  // Priors are corrected when the turn is at least this many sigmas.
  double min_num_sigmas = 5.0;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct CameraMountReport {
  // The priors were turned.
  bool corrected = false;
  int num_pairs = 0;
  // The true camera frame from the one that T_cam_imu states, a rotation
  // vector: what was found, applied or not.
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();
  // 1 sigma of its angle, whatever of it the direction of driving may have.
  double sigma_rad = 0.0;
  // The squared size of both turns in sigmas.
  double chi2 = 0.0;
  // What is left in the priors, corrected or not; none where no pair has a
  // direction.
  std::optional<SharedTurns> left_in_priors;
  // Squared residuals of the pairs per degree of freedom; sigmas grow with what
  // is above 1, as noise that the sensors do not declare does not average out.
  double residual_variance = 0.0;
};

// Finds by what rotation E of the camera T_cam_imu is wrong, and takes it out
// of the priors: R^ -> E R^ E^T, t^ -> E t^. Vision sees the axis about which
// the camera turns (R = E R^ E^T for each pair), and where it moves to: with
// the sensors' rotation held, a pair's matches have one direction, E t^. The
// direction of driving may be wrong in the same way, and directions cannot tell
// the two apart: it is an unknown of its own (kDrivingDirectionSigmaRad), which
// shares the blame and widens E's sigma to what rotations leave open. Linear in
// both, a constant gyroscope bias and an offset of all visual rotations
// (kOffsetSigmaRad), Huber weights, relinearised. The covariance is that of
// spans of the drive, whose pairs share their errors.
// chain has the errors that differ from step to step (WithoutSharedErrors);
// graph has rotations that do not know the priors (RefineRelativePoses without
// predictions); pairs that are far apart or not of the chain are passed over.
CameraMountReport CorrectCameraMount(
    const CameraMountOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const GlobalCorrespondences& correspondences,
    std::vector<RelativePosePrior>* priors);

// The prior as a camera turned by this rotation would have it.
void TurnPrior(const Eigen::Quaterniond& turned_from_cam,
               RelativePosePrior* prior);

}  // namespace adasfm
