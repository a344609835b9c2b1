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
  // 1 sigma of a keypoint's position; the unit in which priors and keypoints
  // are compared. Half a pixel is the noise of one keypoint where residuals do
  // not tell it yet; variance_components.h finds it, and what keypoints have in
  // common.
  double keypoint_sigma_px = 0.5;
  // Of single cameras, over keypoint_sigma_px; those that are missing have 1.
  std::map<camera_t, double> keypoint_sigma_ratios;
  // Where the robust loss on reprojection errors (Cauchy) takes over, in px:
  // four sigmas of the noise, with which variance_components.h scales it, and
  // as many of each camera's own.
  // Wrong matches that agree with a point to a few pixels would pull at its
  // images.
  // <= 0: plain squares.
  double reproj_loss_scale_px = 2.0;
  // Where the robust loss (Cauchy) on whitened prior terms takes over, in
  // sigmas. It drops single wrong priors; many that vision contradicts together
  // are what variance_components.h is for.
  double prior_loss_scale = 3.0;
  // Of the priors' sigmas alone: what is believed of the shared errors stays.
  PriorSigmaFactors prior_sigma_factors = kStatedPriorSigmas;
  // 1 sigma of the inertial motions, m/s^2 sqrt(s), before the factor of
  // kVelocity; 0: of what the poses at the start leave.
  double accelerometer_noise = 0.0;

  // Where the robust loss (Cauchy) on whitened positions takes over, in sigmas.
  // Larger while the model is still bent.
  double position_loss_scale = 3.0;

  SharedErrorOptions shared_errors;

  bool refine_focal_length = false;
  bool refine_principal_point = false;
  bool refine_extra_params = false;

  int max_num_iterations = 50;
  // Relative change of the cost at which the adjustment has converged.
  double function_tolerance = 1e-5;
  // -1: all. The result does not depend on it; where Ceres solves, up to
  // rounding.
  int num_threads = 1;
  // Where Ceres solves (docs/reference/math.md), up to so many images densely;
  // what has a larger factor than the second number of them iteratively.
  int max_num_images_dense = 50;
  int max_num_images_sparse = 5000;
  // Of the process, in GB (1e9 bytes): where more would be taken, images that
  // share few points count as sharing none (docs/reference/math.md). -1: as
  // much as the adjustment needs.
  double max_memory_gb = -1.0;

  bool RefinesCameras() const {
    return refine_focal_length || refine_principal_point || refine_extra_params;
  }
  bool IsValid(std::string* error) const;
};

// Which images take part. Points are those that the images observe; points seen
// by other registered images too keep those observations only when the other
// image takes part.
struct PriorBundleAdjustmentProblem {
  // Registered images whose poses are adjusted.
  std::set<image_t> images;
  // Registered images that take part with fixed poses.
  std::set<image_t> constant_images;
  // Cameras whose intrinsics stay, whatever the options refine.
  std::set<camera_t> constant_cameras;
  // Those of sensors in order of time: a window of the shared errors ends where
  // a prior does not begin with the image that the last one ended with.
  std::vector<PosePriorEdge> priors;
  // Positions in the reconstruction's world, which then has no free degrees of
  // freedom; those of images that do not take part are passed over.
  std::vector<PositionPrior> positions;
  // Of consecutive images in order of time, for a model whose unit is about the
  // metre (inertial_factors.h).
  std::vector<InertialMotion> inertial_motions;
  // Unit vectors towards the ground (-z of the world) in the cameras' frames,
  // together one measurement of the vertical with this 1 sigma. Used with
  // positions only.
  std::map<image_t, Eigen::Vector3d> gravity_in_cam;
  double gravity_sigma_rad = std::numeric_limits<double>::infinity();
  // Each frame of these rigs has one pose, and the cam_from_rig of each camera,
  // which the rigs know up to their sigmas, is estimated; priors within a frame
  // are passed over. Cameras without cam_from_rig, and all of them beside
  // constant images, have a pose for each image.
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
  // 1 sigma of the metre that they tell, as a ratio, where
  // AdjustBundleWithVarianceComponents found their noise; else 0.
  double unit_sigma = 0.0;
  std::string message;
  // Of the priors, where AdjustBundleWithVarianceComponents made the
  // adjustment: the largest chi-square per degree of freedom of a kind of term
  // (with the redundancy only where it estimates the keypoint sigma),
  double prior_chi2_per_dof = 0.0;
  // and whether their mean squares are within what the balance asks for.
  bool priors_agree = true;
  // Of the priors with a duration; all zero on failure.
  SharedErrors shared_errors;
};

struct ReducedSystem;

// Adjusts poses, points and, on request, intrinsics of the reconstruction with
// the priors; `system` (optional) is the adjustment linearised at its end
// (reduced_system.h). Metres are kept when the priors have lengths; otherwise
// seven degrees of freedom are held by the first image and the distance to the
// image farthest from it. On failure the reconstruction is left as it was.
PriorBundleAdjustmentSummary AdjustBundle(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction,
    std::unique_ptr<ReducedSystem>* system = nullptr);

}  // namespace adasfm
