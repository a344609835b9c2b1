// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/variance_components.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/bundle_adjustment/linear_adjustment.h"
#include "colmap_ext/bundle_adjustment/prior_components.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"

namespace adasfm {
namespace {

// Synthetic keypoints have no noise; weights need a bound.
constexpr double kMinKeypointSigmaPx = 0.02;
// Relative change of the cost at which an adjustment of the search ends.
constexpr double kSearchFunctionTolerance = 1e-3;
// Factors of the sigma per step; smaller ones would only repeat the adjustment.
constexpr double kMinStep = 1.25;
constexpr double kMaxStep = 2.0;
// Before the priors' sigmas are estimated. The model is as good as after its
// last adjustment; the linear step makes up for the remainder.
constexpr int kNumIterationsBeforeSigmas = 1;
// Sigmas of priors are lowered to this share at most, the factor that the
// importer allows for noise figures, and not raised. The sigma of velocities
// starts as a guess that contains vision's noise.
constexpr PriorSigmaFactors kMinSigmaFactors = {0.2, 0.2, 0.2, 0.2, 0.02};
constexpr PriorSigmaFactors kMaxSigmaFactors = {1.0, 1.0, 1.0, 1.0, 10.0};
// The search for the factors, in linear steps, ends when none changes by more.
constexpr double kMaxSigmaChange = 1.03;
constexpr int kMaxNumSigmaSteps = 20;

struct PriorSigmaEstimate {
  PriorSigmaFactors factors = kStatedPriorSigmas;
  // The components at these sigmas.
  PriorComponents components;
};

// Lowers the sigmas that the residuals show to be too large, to the estimate
// plus one standard deviation, and estimates that of velocities. None when the
// system is singular.
std::optional<PriorSigmaEstimate> EstimatePriorSigmas(
    LinearAdjustment* linear) {
  PriorSigmaEstimate estimate;
  PriorSigmaFactors& factors = estimate.factors;
  PriorComponents& components = estimate.components;
  double change = std::numeric_limits<double>::infinity();
  for (int step = 0; step < kMaxNumSigmaSteps && change > kMaxSigmaChange;
       ++step) {
    if (!linear->Solve(factors, &components)) return std::nullopt;
    change = 1.0;
    for (int k = 0; k < kNumPriorTerms; ++k) {
      if (components[k].num_residuals == 0) continue;
      const double step = static_cast<PriorTerm>(k) == PriorTerm::kVelocity
                              ? components[k].ScoringStep()
                              : components[k].Chi2PerDof();
      const double factor =
          std::clamp(factors[k] * std::sqrt(step), kMinSigmaFactors[k],
                     kMaxSigmaFactors[k]);
      change = std::max({change, factor / factors[k], factors[k] / factor});
      factors[k] = factor;
    }
  }
  for (int k = 0; k < kNumPriorTerms; ++k) {
    factors[k] =
        std::min(kMaxSigmaFactors[k],
                 factors[k] * std::sqrt(1.0 + components[k].Chi2Sigma()));
  }
  if (!linear->Solve(factors, &components)) return std::nullopt;
  return estimate;
}

// One adjustment, repeated until its sigmas agree with its residuals.
class VarianceComponentAdjustment {
 public:
  VarianceComponentAdjustment(const VarianceComponentOptions& balance,
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
    const KeypointSigmas sigmas = EstimateKeypointSigmas(reconstruction_);
    given_.keypoint_sigma_px =
        std::max(kMinKeypointSigmaPx,
                 sigmas.of_all_px.value_or(options.keypoint_sigma_px));
    // The loss scale follows the noise, not the errors that keypoints share.
    options_.reproj_loss_scale_px *=
        given_.keypoint_sigma_px / options.keypoint_sigma_px;
    for (const auto& [camera_id, sigma_px] : sigmas.of_cameras_px) {
      options_.keypoint_sigma_ratios[camera_id] =
          std::max(kMinKeypointSigmaPx, sigma_px) / given_.keypoint_sigma_px;
    }
  }

  PriorBundleAdjustmentSummary Run() {
    const bool has_priors = !problem_.priors.empty();
    if (has_priors && balance_.estimate_keypoint_sigma &&
        balance_.estimate_prior_sigmas && IsSmallEnough()) {
      EstimateSigmas();
    }
    if (has_priors && balance_.enabled) RaiseKeypointSigma();
    if (!is_final_) Adjust(given_.function_tolerance);
    if (summary_.success && has_priors) DescribePriors();
    summary_.unit_sigma = unit_sigma_;
    return summary_;
  }

 private:
  bool Adjust(double function_tolerance) {
    options_.function_tolerance = function_tolerance;
    options_.keypoint_sigma_px = given_.keypoint_sigma_px * factor_;
    is_final_ = function_tolerance == given_.function_tolerance;
    system_.reset();
    Add(AdjustBundle(options_, problem_, &reconstruction_,
                     NeedsSystem() ? &system_ : nullptr));
    return summary_.success;
  }

  void Add(const PriorBundleAdjustmentSummary& summary) {
    const PriorBundleAdjustmentSummary before = summary_;
    summary_ = summary;
    summary_.num_iterations += before.num_iterations;
    summary_.min_num_shared_points =
        std::max(summary.min_num_shared_points, before.min_num_shared_points);
  }

  // The linear system's factorisation has been timed below this size only.
  bool IsSmallEnough() const {
    return static_cast<int>(problem_.images.size()) <=
           options_.max_num_images_sparse;
  }

  // For the redundancies of the priors. An estimate of the priors' sigmas has
  // found them already, as long as the keypoint sigma stays the same.
  bool NeedsSystem() const {
    return is_final_ && balance_.estimate_keypoint_sigma &&
           !problem_.priors.empty() && IsSmallEnough() &&
           redundancies_factor_ != factor_;
  }

  // The components at the present poses, with the shares of the last estimate.
  PriorComponents Components() const {
    PriorComponents components = ComputePriorComponents(
        options_.prior_sigma_factors,
        CorrectSharedErrors(options_.shared_errors, summary_.shared_errors,
                            problem_.priors),
        reconstruction_);
    for (int k = 0; k < kNumPriorTerms; ++k) {
      components[k].redundancy_share = components_[k].redundancy_share;
    }
    return components;
  }

  // Runs before the keypoint sigma is raised: a larger one would explain the
  // residuals of the priors by itself.
  void EstimateSigmas() {
    PriorBundleAdjustmentOptions options = options_;
    options.keypoint_sigma_px = given_.keypoint_sigma_px * factor_;
    options.max_num_iterations = kNumIterationsBeforeSigmas;
    Add(AdjustBundle(options, problem_, &reconstruction_, &system_));
    if (!summary_.success) return;
    options_.accelerometer_noise = summary_.accelerometer_noise;
    LinearAdjustment linear(system_.get(), options.prior_loss_scale);
    const std::optional<PriorSigmaEstimate> estimate =
        EstimatePriorSigmas(&linear);
    if (!estimate) return;
    unit_sigma_ = std::sqrt(linear.UnitVariance());
    options_.prior_sigma_factors = estimate->factors;
    components_ = estimate->components;
    redundancies_factor_ = factor_;
  }

  // Where the sigma needs no raising, the first adjustment is the last. The
  // search uses a looser tolerance.
  void RaiseKeypointSigma() {
    const double tolerance =
        std::max(given_.function_tolerance, kSearchFunctionTolerance);
    if (!HasEstimate()) {
      if (!Adjust(given_.function_tolerance)) return;
      components_ = Components();
    }
    while (true) {
      const double mean_square = LargestMeanSquare(components_);
      const bool raises = mean_square > kMaxPriorMeanSquare &&
                          factor_ < balance_.max_sigma_factor;
      if (!raises && is_final_) return;
      if (raises) {
        factor_ = std::min(
            balance_.max_sigma_factor,
            factor_ * std::clamp(std::sqrt(mean_square / kMaxPriorMeanSquare),
                                 kMinStep, kMaxStep));
      }
      if (!Adjust(raises ? tolerance : given_.function_tolerance)) return;
      components_ = Components();
    }
  }

  bool HasEstimate() const { return redundancies_factor_ > 0.0; }

  void DescribePriors() {
    summary_.priors_agree =
        LargestMeanSquare(Components()) <= kMaxPriorMeanSquare;
    if (system_) {
      LinearAdjustment linear(system_.get(), options_.prior_loss_scale);
      linear.Solve(kStatedPriorSigmas, &components_);
    }
    summary_.prior_chi2_per_dof = LargestChi2PerDof(Components());
  }

  const VarianceComponentOptions& balance_;
  // With the keypoint sigma that the residuals show.
  PriorBundleAdjustmentOptions given_;
  PriorBundleAdjustmentOptions options_;
  const PriorBundleAdjustmentProblem& problem_;
  double& factor_;
  colmap::Reconstruction& reconstruction_;
  PriorBundleAdjustmentSummary summary_;
  // The last adjustment linearised at its end, where needed.
  std::unique_ptr<ReducedSystem> system_;
  // The newest components, and the factor of the keypoint sigma at which their
  // redundancies were estimated.
  PriorComponents components_;
  double redundancies_factor_ = 0.0;
  double unit_sigma_ = 0.0;
  // The last adjustment was with the sigmas in use and the tolerance given.
  bool is_final_ = false;
};

}  // namespace

double ComputePriorMeanSquare(const std::vector<PosePriorEdge>& priors,
                              const colmap::Reconstruction& reconstruction) {
  return LargestMeanSquare(
      ComputePriorComponents(kStatedPriorSigmas, priors, reconstruction));
}

PriorBundleAdjustmentSummary AdjustBundleWithVarianceComponents(
    const VarianceComponentOptions& balance,
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction, double* keypoint_sigma_factor) {
  return VarianceComponentAdjustment(balance, options, problem,
                                     keypoint_sigma_factor, reconstruction)
      .Run();
}

}  // namespace adasfm
