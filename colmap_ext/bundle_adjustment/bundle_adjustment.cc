// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/bundle_adjustment/factor_plan.h"
#include "colmap_ext/bundle_adjustment/inertial_factors.h"
#include "colmap_ext/bundle_adjustment/minimize_bundle.h"
#include "colmap_ext/bundle_adjustment/position_priors.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/stopwatch.h"

namespace adasfm {
namespace {

// Relative 1 sigma of the distance that fixes a scale which nothing measures.
// No residual contradicts the distance, so the value is not a weight.
constexpr double kGaugeLengthRatio = 1e-3;
// The length and the bends of a chain are weakly constrained. With the initial
// damping of Ceres (radius 1e4) they would change a little at each of many
// steps, and an adjustment would end before they converge.
constexpr double kInitialTrustRegionRadius = 1e10;
// Problems with fewer residuals are solved faster by one thread.
constexpr int kMinNumResidualsForThreads = 20000;

bool HasMeasuredLengths(const std::vector<PosePriorEdge>& priors) {
  return std::any_of(priors.begin(), priors.end(), [](const auto& edge) {
    return edge.is_length_measured && std::isfinite(edge.length_sigma_m);
  });
}

// Fixes the degrees of freedom that the data leave open (see AdjustBundle).
void FixGauge(bool has_lengths, BundleProblem* problem) {
  const std::vector<image_t> constant_images = problem->ConstantImages();
  if (constant_images.empty()) problem->FixFirstPose();
  if (has_lengths || constant_images.size() >= 2) return;
  problem->FixDistanceToFarthestPose(kGaugeLengthRatio);
}

int NumThreads(const PriorBundleAdjustmentOptions& options,
               const BundleProblem& problem) {
  return problem.NumResiduals() < kMinNumResidualsForThreads
             ? 1
             : EffectiveNumThreads(options.num_threads);
}

ceres::Solver::Options SolverOptions(
    const PriorBundleAdjustmentOptions& options, bool has_small_factor,
    BundleProblem* problem) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.initial_trust_region_radius = kInitialTrustRegionRadius;
  // The cost alone decides: gradients and steps have no common unit here.
  solver.gradient_tolerance = 1e-12;
  solver.parameter_tolerance = 1e-12;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = NumThreads(options, *problem);
  solver.max_linear_solver_iterations = 200;
  solver.max_num_consecutive_invalid_steps = 10;
  const int num_images = problem->NumImages();
  const bool has_points = problem->NumPoints() > 0;
  if (num_images <= options.max_num_images_dense && has_points) {
    solver.linear_solver_type = ceres::DENSE_SCHUR;
  } else if (!has_points) {
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  } else if (has_small_factor) {
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
  } else {
    solver.linear_solver_type = ceres::ITERATIVE_SCHUR;
    solver.preconditioner_type = ceres::SCHUR_JACOBI;
  }
  if (has_points) solver.linear_solver_ordering = problem->Ordering();
  return solver;
}

// Sets the solver's figures, and whether its parameters may be used.
void SolveWithCeres(const PriorBundleAdjustmentOptions& options,
                    bool has_small_factor, BundleProblem* bundle,
                    PriorBundleAdjustmentSummary* summary) {
  ceres::Solver::Summary solver_summary;
  ceres::Solve(SolverOptions(options, has_small_factor, bundle),
               bundle->CeresProblem(), &solver_summary);
  summary->num_iterations = solver_summary.num_successful_steps +
                            solver_summary.num_unsuccessful_steps;
  summary->initial_cost = solver_summary.initial_cost;
  summary->final_cost = solver_summary.final_cost;
  summary->message = solver_summary.message;
  summary->success = solver_summary.IsSolutionUsable();
}

void SolveByPoints(const PriorBundleAdjustmentOptions& options,
                   BundleProblem* bundle,
                   PriorBundleAdjustmentSummary* summary) {
  MinimizeBundleOptions minimize;
  minimize.max_num_iterations = options.max_num_iterations;
  minimize.function_tolerance = options.function_tolerance;
  minimize.initial_radius = kInitialTrustRegionRadius;
  minimize.num_threads = NumThreads(options, *bundle);
  const MinimizeBundleSummary minimized = MinimizeBundle(minimize, bundle);
  summary->num_iterations = minimized.num_iterations;
  summary->initial_cost = minimized.initial_cost;
  summary->final_cost = minimized.final_cost;
  summary->message = minimized.message;
  summary->success = minimized.success;
}

}  // namespace

bool PriorBundleAdjustmentOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
             .Positive({{"keypoint_sigma_px", keypoint_sigma_px},
                        {"prior_loss_scale", prior_loss_scale},
                        {"position_loss_scale", position_loss_scale}})
             .Require(std::isfinite(reproj_loss_scale_px),
                      "reproj_loss_scale_px", reproj_loss_scale_px,
                      "must be finite")
             .AtLeast(1, "max_num_iterations", max_num_iterations)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .NotNegative({{"function_tolerance", function_tolerance},
                           {"accelerometer_noise", accelerometer_noise}})
             .AtLeast(max_num_images_dense, "max_num_images_sparse",
                      max_num_images_sparse)
             .AllHold() &&
         shared_errors.IsValid(error);
}

PriorBundleAdjustmentSummary AdjustBundle(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction,
    std::unique_ptr<ReducedSystem>* system) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);

  PriorBundleAdjustmentSummary summary;
  summary.keypoint_sigma_px = options.keypoint_sigma_px;
  summary.keypoint_sigma_ratios = options.keypoint_sigma_ratios;
  summary.prior_sigma_factors = options.prior_sigma_factors;
  PriorBundleAdjustmentProblem with_windows = problem;
  AssignSharedErrorWindows(options.shared_errors, &with_windows.priors);
  FactorPlan plan =
      PlanFactor(problem, *reconstruction, options.max_num_images_sparse,
                 options.max_memory_gb);
  BundleProblem bundle(options, with_windows, *reconstruction,
                       /*may_keep_points_apart=*/plan.is_small,
                       plan.cut ? &*plan.cut : nullptr);
  plan.cut.reset();
  summary.min_num_shared_points = plan.min_num_shared_points;
  const InertialTerms inertial =
      AddInertialFactors(options, problem.inertial_motions, &bundle);
  summary.accelerometer_noise = inertial.noise;
  summary.num_images = bundle.NumImages();
  summary.num_points = bundle.NumPoints();
  summary.num_residuals = bundle.NumResiduals();
  if (bundle.NumImages() == 0 || bundle.NumResiduals() == 0) {
    summary.message = "nothing to adjust";
    return summary;
  }
  if (AddPositionPriors(options.position_loss_scale, problem, &bundle) <
      kMinNumPositionsForGauge) {
    FixGauge(HasMeasuredLengths(problem.priors), &bundle);
  }

  const Stopwatch watch;
  if (bundle.NumPointsApart() > 0) {
    SolveByPoints(options, &bundle, &summary);
  } else {
    SolveWithCeres(options, plan.is_small, &bundle, &summary);
  }
  summary.seconds = watch.Seconds();
  summary.success =
      summary.success && std::isfinite(summary.final_cost) && bundle.IsFinite();
  if (summary.success) {
    bundle.UpdatePoses();  // The last step may have been taken back.
    bundle.WriteTo(reconstruction);
    summary.shared_errors = bundle.EstimatedSharedErrors();
    if (system != nullptr) *system = BuildReducedSystem(&bundle, inertial.unit);
  }
  return summary;
}

}  // namespace adasfm
