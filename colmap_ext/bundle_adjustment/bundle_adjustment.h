// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/cost_functions/pose_prior_edge.h"
#include "colmap_ext/cost_functions/shared_errors.h"
#include "colmap_ext/host/colmap.h"
#include "core/camera_rig.h"
#include "core/inertial_motion.h"
#include "core/position_prior.h"
#include "core/types.h"

namespace adasfm {

struct PriorBundleAdjustmentOptions {
  // 1 sigma of a keypoint's position, the unit in which priors and keypoints
  // are compared. Half a pixel is the noise of one keypoint before residuals
  // show it; variance_components.h estimates it, and the errors that keypoints
  // share.
  double keypoint_sigma_px = 0.5;
  // Sigmas of single cameras over keypoint_sigma_px; missing cameras have 1.
  std::map<camera_t, double> keypoint_sigma_ratios;
  // Scale of the robust loss (Cauchy) on reprojection errors, in px: four
  // sigmas of the noise, with which variance_components.h scales it. A camera
  // with its own sigma has four of its own. Without the loss, wrong matches
  // that agree with a point to a few pixels would bias its images.
  // <= 0: plain squares.
  double reproj_loss_scale_px = 2.0;
  // Scale of the robust loss (Cauchy) on whitened prior terms, in sigmas. It
  // rejects single wrong priors; variance_components.h treats many priors that
  // vision contradicts together.
  double prior_loss_scale = 3.0;
  // Multiplies the sigmas of priors; those of the shared errors stay.
  PriorSigmaFactors prior_sigma_factors = kStatedPriorSigmas;
  // 1 sigma of the inertial motions, m/s^2 sqrt(s), before the factor of
  // kVelocity. 0: from the residuals at the initial poses.
  double accelerometer_noise = 0.0;

  // Scale of the robust loss (Cauchy) on whitened positions, in sigmas. Larger
  // while the model is still deformed.
  double position_loss_scale = 3.0;

  SharedErrorOptions shared_errors;

  bool refine_focal_length = false;
  bool refine_principal_point = false;
  bool refine_extra_params = false;

  int max_num_iterations = 50;
  // Relative change of the cost at which the adjustment has converged.
  double function_tolerance = 1e-5;
  // -1: all. The result does not depend on it, up to rounding where Ceres
  // solves.
  int num_threads = 1;
  // Where Ceres solves (docs/reference/math.md): densely up to the first number
  // of images; iteratively where the factor is larger than that of the second
  // number of images that all see each other.
  int max_num_images_dense = 50;
  int max_num_images_sparse = 5000;
  // Memory bound of the process in GB (1e9 bytes). Where an adjustment would
  // exceed it, images that share few points count as sharing none
  // (docs/reference/math.md). -1: no bound.
  double max_memory_gb = -1.0;

  bool RefinesCameras() const {
    return refine_focal_length || refine_principal_point || refine_extra_params;
  }
  bool IsValid(std::string* error) const;
};

// Which images take part. Points are those that the images observe; an
// observation of such a point in another registered image counts only when that
// image takes part.
struct PriorBundleAdjustmentProblem {
  // Registered images whose poses are adjusted.
  std::set<image_t> images;
  // Registered images that take part with fixed poses.
  std::set<image_t> constant_images;
  // Cameras whose intrinsics stay, whatever the options refine.
  std::set<camera_t> constant_cameras;
  // Sensor priors in order of time: a window of the shared errors ends where a
  // prior does not begin with the image that ended the previous one.
  std::vector<PosePriorEdge> priors;
  // Positions in the reconstruction's world, whose gauge they fix; positions of
  // images that do not take part are ignored.
  std::vector<PositionPrior> positions;
  // Motions between consecutive images in order of time; the unit of the model
  // must be about the metre (inertial_factors.h).
  std::vector<InertialMotion> inertial_motions;
  // Unit vectors towards the ground (-z of the world) in the camera frames.
  // Together they are one measurement of the vertical with this 1 sigma. Used
  // with positions only.
  std::map<image_t, Eigen::Vector3d> gravity_in_cam;
  double gravity_sigma_rad = std::numeric_limits<double>::infinity();
  // Each frame of these rigs has one pose. The cam_from_rig of each camera is
  // estimated, with the value and sigmas of the rig as prior; priors within a
  // frame are ignored. Images of cameras without cam_from_rig have a pose each,
  // and so have all images where there are constant images.
  CameraRigs rigs;
};

struct PriorBundleAdjustmentSummary {
  bool success = false;
  int num_residuals = 0;
  int num_images = 0;
  int num_points = 0;
  int num_iterations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  double seconds = 0.0;
  // Images that share fewer points counted as sharing none (FactorPlan).
  int min_num_shared_points = 1;
  // The sigmas that were used.
  double keypoint_sigma_px = 0.0;
  std::map<camera_t, double> keypoint_sigma_ratios;
  PriorSigmaFactors prior_sigma_factors = kStatedPriorSigmas;
  // 0 without inertial motions.
  double accelerometer_noise = 0.0;
  // Relative 1 sigma of the metre that the inertial motions determine, where
  // AdjustBundleWithVarianceComponents estimated their noise; else 0.
  double unit_sigma = 0.0;
  std::string message;
  // Set by AdjustBundleWithVarianceComponents: the largest chi-square per
  // degree of freedom of a kind of prior term (with the redundancy only where
  // the keypoint sigma is estimated).
  double prior_chi2_per_dof = 0.0;
  // Whether the priors' mean squares are within the balance's limit.
  bool priors_agree = true;
  // Shared errors of the priors with a duration; all zero on failure.
  SharedErrors shared_errors;
};

struct ReducedSystem;

// Adjusts poses, points and, on request, intrinsics of the reconstruction with
// the priors; `system` (optional) receives the adjustment linearised at its end
// (reduced_system.h). Metres are kept when the priors have lengths; otherwise
// the first image and the distance to the image farthest from it fix seven
// degrees of freedom. On failure the reconstruction is unchanged.
PriorBundleAdjustmentSummary AdjustBundle(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction,
    std::unique_ptr<ReducedSystem>* system = nullptr);

}  // namespace adasfm
