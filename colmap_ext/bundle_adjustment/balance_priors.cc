// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/balance_priors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/bundle_adjustment/prior_components.h"

namespace adasfm {
namespace {

constexpr double kTornNumSigmas = 10.0;
// Made-up keypoints have no noise, and weights need an end.
constexpr double kMinKeypointSigmaPx = 0.02;
// Relative change of the cost at which an adjustment of the search ends.
constexpr double kSearchFunctionTolerance = 1e-3;
// Steps of the search: small ones would only repeat the adjustment.
constexpr double kMinStep = 1.25;
constexpr double kMaxStep = 2.0;
// Sigmas of priors are lowered this often, at most to this share (the importer
// grants noise figures the same factor), and for as long as they change by
// more.
constexpr int kMaxNumCorrections = 2;
constexpr double kMinSigmaFactor = 0.2;
constexpr double kMinSigmaChange = 1.1;

// Lowers the sigmas that the residuals refute as too large, as far as one
// standard deviation of the estimate goes; whether any moved enough to matter.
bool LowerSigmas(const PriorComponents& components,
                 PriorSigmaFactors* factors) {
  bool any = false;
  for (int k = 0; k < kNumPriorTerms; ++k) {
    const PriorComponent& component = components[k];
    if (component.mean_square == 0.0) continue;  // Too few.
    const double factor =
        std::clamp((*factors)[k] * std::sqrt(component.VarianceFactor() +
                                             component.VarianceFactorSigma()),
                   kMinSigmaFactor, 1.0);
    const double change = factor / (*factors)[k];
    if (std::max(change, 1.0 / change) < kMinSigmaChange) continue;
    (*factors)[k] = factor;
    any = true;
  }
  return any;
}

// One adjustment, repeated until its sigmas agree with its residuals.
class BalancedAdjustment {
 public:
  BalancedAdjustment(const PriorBalanceOptions& balance,
                     const PriorBundleAdjustmentOptions& options,
                     const PriorBundleAdjustmentProblem& problem,
                     double* keypoint_sigma_factor,
                     colmap::Reconstruction* reconstruction)
      : balance_(balance),
        given_(options),
        options_(options),
        problem_(problem),
        factor_(*keypoint_sigma_factor),
        reconstruction_(*reconstruction) {
    if (!balance.estimate_keypoint_sigma) return;
    given_.keypoint_sigma_px =
        std::max(kMinKeypointSigmaPx, EstimateKeypointSigma(reconstruction_)
                                          .value_or(options.keypoint_sigma_px));
  }

  PriorBundleAdjustmentSummary Run() {
    const bool has_priors = !problem_.priors.empty();
    const bool estimates_priors = has_priors &&
                                  balance_.estimate_keypoint_sigma &&
                                  balance_.estimate_prior_sigmas;
    if (estimates_priors) EstimatePriorSigmas();
    if (has_priors && balance_.enabled) RaiseKeypointSigma();
    if (!is_final_) Adjust(given_.function_tolerance);
    if (summary_.success && has_priors) {
      PriorComponents components = Components();
      if (estimates_priors) EstimateRedundancies(&components);
      summary_.prior_chi2_per_dof = LargestChi2PerDof(components);
    }
    return summary_;
  }

 private:
  bool Adjust(double function_tolerance) {
    options_.function_tolerance = function_tolerance;
    options_.keypoint_sigma_px = given_.keypoint_sigma_px * factor_;
    is_final_ = function_tolerance == given_.function_tolerance;
    const int num_iterations = summary_.num_iterations;
    summary_ = AdjustBundle(options_, problem_, &reconstruction_);
    summary_.num_iterations += num_iterations;
    return summary_.success;
  }

  PriorComponents Components() const {
    return ComputePriorComponents(
        options_.prior_sigma_factors,
        CorrectSharedErrors(options_.shared_errors, summary_.shared_errors,
                            problem_.priors),
        reconstruction_);
  }

  bool EstimateRedundancies(PriorComponents* components) const {
    return adasfm::EstimateRedundancies(options_, problem_,
                                        summary_.shared_errors, reconstruction_,
                                        components);
  }

  // While keypoints weigh what their residuals show: a larger sigma would
  // explain what is left of the priors by itself.
  void EstimatePriorSigmas() {
    for (int k = 0; k < kMaxNumCorrections; ++k) {
      if (!Adjust(given_.function_tolerance)) return;
      PriorComponents components = Components();
      if (!EstimateRedundancies(&components) ||
          !LowerSigmas(components, &options_.prior_sigma_factors)) {
        return;
      }
      is_final_ = false;
    }
  }

  // The search needs no last digits.
  void RaiseKeypointSigma() {
    const double tolerance =
        std::max(given_.function_tolerance, kSearchFunctionTolerance);
    if (!is_final_ && !Adjust(tolerance)) return;
    while (factor_ < balance_.max_sigma_factor) {
      const double chi2 = LargestChi2PerDof(Components());
      if (chi2 > balance_.max_chi2_per_dof) {
        factor_ = std::min(
            balance_.max_sigma_factor,
            factor_ * std::clamp(std::sqrt(chi2 / balance_.max_chi2_per_dof),
                                 kMinStep, kMaxStep));
      } else if (is_final_) {
        return;
      }
      if (!Adjust(chi2 > balance_.max_chi2_per_dof
                      ? tolerance
                      : given_.function_tolerance)) {
        return;
      }
    }
  }

  const PriorBalanceOptions& balance_;
  // With the keypoint sigma that the residuals show.
  PriorBundleAdjustmentOptions given_;
  PriorBundleAdjustmentOptions options_;
  const PriorBundleAdjustmentProblem& problem_;
  double& factor_;
  colmap::Reconstruction& reconstruction_;
  PriorBundleAdjustmentSummary summary_;
  // The last adjustment was with the sigmas in use and the tolerance given.
  bool is_final_ = false;
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
  return LargestChi2PerDof(
      ComputePriorComponents({1.0, 1.0, 1.0, 1.0}, priors, reconstruction));
}

int CountTornPriors(const std::vector<PosePriorEdge>& priors,
                    const colmap::Reconstruction& reconstruction) {
  return std::count_if(
      priors.begin(), priors.end(), [&](const PosePriorEdge& edge) {
        return LargestNumSigmas(edge, reconstruction) > kTornNumSigmas;
      });
}

PriorBundleAdjustmentSummary AdjustBundleInBalance(
    const PriorBalanceOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction, double* keypoint_sigma_factor) {
  std::string error;
  if (!balance.IsValid(&error)) throw std::invalid_argument(error);
  return BalancedAdjustment(balance, options, problem, keypoint_sigma_factor,
                            reconstruction)
      .Run();
}

}  // namespace adasfm
