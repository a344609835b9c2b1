// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/so3.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

// 1 sigma per axis, added to the estimate's covariance: the principal point and
// the wheels' axis of a good calibration are off by as much.
inline constexpr double kMinCameraImuSigmaDeg = 0.05;
// Priors are corrected when the errors are at least this many sigmas (chi2),
// and the rotation at least this many times kMinCameraImuSigmaDeg.
inline constexpr double kMinNumCameraImuSigmas = 5.0;

struct CameraImuRotationOptions {
  bool enabled = true;
  // 1 sigma of the calibration's error, per axis. Keeps axes that a drive does
  // not observe (the roll of a straight one) at zero.
  double sigma_deg = 5.0;
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct CameraImuRotationReport {
  // Whether the priors were rotated.
  bool corrected = false;
  int num_pairs = 0;
  // The true camera frame from the one that T_cam_imu states, a rotation
  // vector: the correction that was applied, else the estimate.
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  // 1 sigma of its angle, with the direction of driving unknown too.
  double sigma_rad = 0.0;
  // Joint chi-square of the errors of the rotation and the direction of
  // driving.
  double chi2 = 0.0;
  // Errors that remain in the priors, corrected or not; none where no pair has
  // a direction.
  std::optional<SharedRotationErrors> left_in_priors;
  // Squared residuals of the pairs per degree of freedom. Above 1 it scales the
  // covariance, as noise that the sensors do not declare does not average out.
  double residual_variance = 0.0;

  // The identity where the priors were not corrected.
  Eigen::Quaterniond Correction() const {
    return corrected ? ExpSo3(rotation_rad) : Eigen::Quaterniond::Identity();
  }
};

// Estimates the error E of the camera's rotation in T_cam_imu and removes it
// from the priors of a drive: R^ -> E R^ E^T, t^ -> E t^. Vision observes E in
// the rotation of each pair (R = E R^ E^T) and in its direction of motion: with
// the sensors' rotation held, the matches have one direction, E t^. The
// direction of driving may be wrong in the same way, which directions cannot
// distinguish from E. It is an unknown of its own (kDrivingDirectionSigmaRad),
// which widens E's sigma to what rotations leave open. The problem is linear in
// both, in a constant gyroscope bias and in an offset of all visual rotations
// (kOffsetSigmaRad); Huber weights, relinearised. Covariance: least squares
// plus a cluster-robust (sandwich) term with spans of the trajectory as
// clusters, since pairs of one span share their errors.
// chain: with only the errors that differ from step to step
// (WithoutSharedErrors). graph: with rotations independent of the priors
// (RefineRelativePoses without predictions). Pairs that are far apart or not in
// the chain are skipped.
CameraImuRotationReport CorrectCameraImuRotation(
    const CameraImuRotationOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, const GlobalCorrespondences& correspondences,
    std::vector<RelativePosePrior>* priors);

// By drive (RelativePosePrior::drive).
using CameraImuRotationReports = std::map<int, CameraImuRotationReport>;
// The corrections that were made.
std::map<int, Eigen::Quaterniond> CameraImuCorrections(
    const CameraImuRotationReports& reports);

}  // namespace adasfm
