// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/balance_priors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kMaxTerm = 25.0;
constexpr double kTornNumSigmas = 10.0;
// Fewer terms of a kind than this are no statistic.
constexpr int kMinNumTerms = 10;
// Made-up keypoints have no noise, and weights need an end.
constexpr double kMinKeypointSigmaPx = 0.02;
// Relative change of the cost at which an adjustment of the search ends.
constexpr double kSearchFunctionTolerance = 1e-3;
// Steps of the search: small ones would only repeat the adjustment.
constexpr double kMinStep = 1.25;
constexpr double kMaxStep = 2.0;

// Mean of the squared whitened errors of one kind of term.
struct TermMean {
  int num_dof = 1;
  double sum = 0.0;
  int count = 0;
  int num_torn = 0;

  void Add(double error, double sigma) {
    if (!std::isfinite(sigma)) return;
    const double whitened = error / sigma;
    num_torn += std::abs(whitened) > kTornNumSigmas;
    sum += std::min(kMaxTerm, whitened * whitened / num_dof);
    ++count;
  }
  double Mean() const { return count < kMinNumTerms ? 0.0 : sum / count; }
};

// The terms of priors at the reconstruction's poses.
struct PriorTerms {
  TermMean rotations{3};
  TermMean directions{2};
  TermMean lengths{1};
  TermMean translations{3};

  void Add(const PosePriorEdge& edge,
           const colmap::Reconstruction& reconstruction) {
    if (!reconstruction.IsImageRegistered(edge.image_id1) ||
        !reconstruction.IsImageRegistered(edge.image_id2)) {
      return;
    }
    const Rigid3d cam2_from_cam1 =
        ComputeCam2FromCam1(CamFromWorld(reconstruction.Image(edge.image_id1)),
                            CamFromWorld(reconstruction.Image(edge.image_id2)));
    const Eigen::Vector3d& translation = cam2_from_cam1.translation;
    const Eigen::Vector3d& prior = edge.cam2_from_cam1.translation;
    rotations.Add(
        AngleBetweenRad(cam2_from_cam1.rotation, edge.cam2_from_cam1.rotation),
        edge.rotation_sigma_rad);
    directions.Add(AngleBetweenRad(translation, prior),
                   edge.direction_sigma_rad);
    lengths.Add(translation.norm() - prior.norm(), edge.length_sigma_m);
    translations.Add((translation - prior).norm(), edge.translation_sigma_m);
  }
};

}  // namespace

bool PriorBalanceOptions::IsValid(std::string* error) const {
  if (!(max_chi2_per_dof >= 1.0)) {
    *error = "max_chi2_per_dof is " + std::to_string(max_chi2_per_dof) +
             ", but honest priors need at least 1";
    return false;
  }
  if (!(max_sigma_factor >= 1.0)) {
    *error = "max_sigma_factor is " + std::to_string(max_sigma_factor) +
             ", but must be at least 1";
    return false;
  }
  return true;
}

double ComputePriorChi2PerDof(const std::vector<PosePriorEdge>& priors,
                              const colmap::Reconstruction& reconstruction) {
  PriorTerms terms;
  for (const PosePriorEdge& edge : priors) {
    if (edge.is_held_by_points) terms.Add(edge, reconstruction);
  }
  return std::max({terms.rotations.Mean(), terms.directions.Mean(),
                   terms.lengths.Mean(), terms.translations.Mean()});
}

int CountTornPriors(const std::vector<PosePriorEdge>& priors,
                    const colmap::Reconstruction& reconstruction) {
  int num_torn = 0;
  for (const PosePriorEdge& edge : priors) {
    PriorTerms terms;
    terms.Add(edge, reconstruction);
    num_torn += terms.rotations.num_torn + terms.directions.num_torn +
                    terms.lengths.num_torn + terms.translations.num_torn >
                0;
  }
  return num_torn;
}

PriorBundleAdjustmentSummary AdjustBundleInBalance(
    const PriorBalanceOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction, double* keypoint_sigma_factor) {
  std::string error;
  if (!balance.IsValid(&error)) throw std::invalid_argument(error);
  PriorBundleAdjustmentOptions adjusted = options;
  PriorBundleAdjustmentSummary summary;
  double keypoint_sigma_px = options.keypoint_sigma_px;
  if (balance.estimate_keypoint_sigma) {
    keypoint_sigma_px = std::max(
        kMinKeypointSigmaPx,
        EstimateKeypointSigma(*reconstruction).value_or(keypoint_sigma_px));
  }
  const bool may_search = balance.enabled && !problem.priors.empty();
  // The search needs no last digits.
  if (may_search) {
    adjusted.function_tolerance =
        std::max(options.function_tolerance, kSearchFunctionTolerance);
  }
  int num_iterations = 0;
  while (true) {
    adjusted.keypoint_sigma_px = keypoint_sigma_px * *keypoint_sigma_factor;
    summary = AdjustBundle(adjusted, problem, reconstruction);
    num_iterations += summary.num_iterations;
    summary.num_iterations = num_iterations;
    if (!summary.success) return summary;
    double chi2 = 0.0;
    if (may_search && *keypoint_sigma_factor < balance.max_sigma_factor) {
      chi2 = ComputePriorChi2PerDof(
          CorrectSharedErrors(options.shared_errors, summary.shared_errors,
                              problem.priors),
          *reconstruction);
    }
    if (chi2 > balance.max_chi2_per_dof) {
      *keypoint_sigma_factor =
          std::min(balance.max_sigma_factor,
                   *keypoint_sigma_factor *
                       std::clamp(std::sqrt(chi2 / balance.max_chi2_per_dof),
                                  kMinStep, kMaxStep));
    } else if (adjusted.function_tolerance > options.function_tolerance) {
      adjusted.function_tolerance = options.function_tolerance;
    } else {
      return summary;
    }
  }
}

}  // namespace adasfm
