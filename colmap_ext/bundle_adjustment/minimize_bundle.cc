// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/minimize_bundle.h"

#include <Eigen/IterativeLinearSolvers>
#include <algorithm>
#include <cmath>
#include <optional>

#include "colmap_ext/bundle_adjustment/bundle_reducer.h"
#include "core/release_memory.h"
#include "core/sparse/ordered_cholesky.h"

namespace adasfm {
namespace {

// Share of the decrease that the linearised residuals predict.
constexpr double kMinRelativeDecrease = 1e-3;
constexpr double kMaxRadius = 1e16;
constexpr double kMinRadius = 1e-32;
constexpr int kMaxNumInvalidSteps = 10;  // One after another.
// Relative residual of a step by conjugate gradients. Costs of drives of 1,000
// and 4,000 images agree to nine digits with those of exact steps.
constexpr double kStepTolerance = 1e-6;
// Conjugate gradients are bound by memory access: in the time of one iteration
// a factorisation makes this many operations for each entry of the factor (45
// to 75 on those drives and on 30,000 images).
constexpr double kOperationsPerEntry = 60.0;
// Memory that was freed while the equations of thousands of images were built
// is as much as a tenth of all memory, beside the factor.
constexpr int kMinNumResidualsToRelease = 1000000;

class TrustRegion {
 public:
  explicit TrustRegion(double radius) : radius_(radius) {}
  double Radius() const { return radius_; }

  void Accept(double relative_decrease) {
    radius_ /=
        std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * relative_decrease - 1.0, 3));
    radius_ = std::min(kMaxRadius, radius_);
    divisor_ = 2.0;
  }
  void Reject() {
    radius_ /= divisor_;
    divisor_ *= 2.0;
  }

 private:
  double radius_;
  double divisor_ = 2.0;
};

// Preconditions conjugate gradients with the factor of a similar matrix.
class FactorPreconditioner : public Eigen::IdentityPreconditioner {
 public:
  using Eigen::IdentityPreconditioner::IdentityPreconditioner;
  void SetFactor(const OrderedCholesky* factor) { factor_ = factor; }
  Eigen::VectorXd solve(const Eigen::VectorXd& residual) const {
    return factor_->solve(residual);
  }

 private:
  const OrderedCholesky* factor_ = nullptr;
};

class BundleMinimizer {
 public:
  BundleMinimizer(const MinimizeBundleOptions& options, BundleProblem* bundle)
      : options_(options),
        reducer_(bundle, options.num_threads),
        region_(options.initial_radius) {
    if (!HasFreePoses()) return;
    factorization_.analyzePattern(reducer_.Matrix().Matrix());
    max_num_gradients_ =
        static_cast<int>(factorization_.NumOperations() /
                         (kOperationsPerEntry * factorization_.NumEntries()));
    if (bundle->NumResiduals() >= kMinNumResidualsToRelease) {
      ReleaseFreedMemory();
    }
  }

  MinimizeBundleSummary Run() {
    for (summary_.num_iterations = 1;; ++summary_.num_iterations) {
      if (summary_.num_iterations > options_.max_num_iterations) {
        return Finish(true, "iterations used up");
      }
      cost_ = reducer_.Linearize(1.0 / region_.Radius());
      if (summary_.num_iterations == 1) summary_.initial_cost = cost_;
      if (reducer_.LargestGradient() <= kGradientAndStepTolerance) {
        return Finish(true, "no gradient is left");
      }
      if (!std::isfinite(cost_)) return Finish(false, "the cost is infinite");
      // CHOLMOD cannot factorise an empty matrix.
      if (!HasFreePoses()) return Finish(true, "no pose is free");
      if (Iterate()) return summary_;
      if (region_.Radius() <= kMinRadius) {
        return Finish(true, "no step is small enough");
      }
    }
  }

 private:
  bool HasFreePoses() { return reducer_.Matrix().Matrix().rows() > 0; }

  MinimizeBundleSummary Finish(bool success, const std::string& message) {
    summary_.success = success;
    summary_.final_cost = cost_;
    summary_.message = message;
    return summary_;
  }

  // The equations change little from step to step, so conjugate gradients need
  // few iterations with the factor of earlier ones. None where they would take
  // longer than a factorisation.
  std::optional<Eigen::VectorXd> SolveWithLastFactor() {
    if (!has_factor_ || max_num_gradients_ == 0) return std::nullopt;
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower,
                             FactorPreconditioner>
        solver;
    solver.preconditioner().SetFactor(&factorization_);
    solver.setTolerance(kStepTolerance);
    solver.setMaxIterations(max_num_gradients_);
    solver.compute(reducer_.Matrix().Matrix());
    const Eigen::VectorXd step = solver.solve(-reducer_.Gradient());
    if (solver.info() != Eigen::Success || !step.allFinite()) {
      return std::nullopt;
    }
    return step;
  }

  // None where the equations are singular.
  std::optional<Eigen::VectorXd> SolveForStep() {
    std::optional<Eigen::VectorXd> step = SolveWithLastFactor();
    if (step) return step;
    factorization_.factorize(reducer_.Matrix().Matrix());
    ++summary_.num_factorizations;
    has_factor_ = factorization_.info() == Eigen::Success;
    if (!has_factor_) return std::nullopt;
    step = factorization_.solve(-reducer_.Gradient());
    if (!step->allFinite()) return std::nullopt;
    return step;
  }

  // Returns whether the minimisation has ended.
  bool Iterate() {
    const std::optional<Eigen::VectorXd> step = SolveForStep();
    if (!step) return EndsWithInvalidStep();
    const BundleReducer::Step moved =
        reducer_.Move(*step, options_.moves_inverse_distances);
    if (!(moved.predicted_decrease > 0.0)) {
      reducer_.TakeBack();
      return EndsWithInvalidStep();
    }
    num_invalid_steps_ = 0;
    const double new_cost = reducer_.MinimizePoints(
        {options_.max_num_point_iterations, options_.function_tolerance});
    const double decrease = cost_ - new_cost;
    const bool is_short =
        std::sqrt(moved.squared_length) <=
        kGradientAndStepTolerance *
            (std::sqrt(moved.squared_norm) + kGradientAndStepTolerance);
    if (is_short || std::abs(decrease) <= options_.function_tolerance * cost_) {
      // Ceres omits the last step; with it the most weakly constrained
      // directions are nearer to the minimum.
      if (decrease > 0.0) {
        cost_ = new_cost;
      } else {
        reducer_.TakeBack();
      }
      Finish(true, "converged");
      return true;
    }
    const double relative_decrease = decrease / moved.predicted_decrease;
    if (relative_decrease > kMinRelativeDecrease) {
      region_.Accept(relative_decrease);
      cost_ = new_cost;
    } else {
      reducer_.TakeBack();
      region_.Reject();
    }
    return false;
  }

  bool EndsWithInvalidStep() {
    region_.Reject();
    has_factor_ = false;  // Conjugate gradients may be what failed.
    if (++num_invalid_steps_ < kMaxNumInvalidSteps) return false;
    Finish(false, "too many invalid steps");
    return true;
  }

  const MinimizeBundleOptions options_;
  BundleReducer reducer_;
  TrustRegion region_;
  OrderedCholesky factorization_;
  bool has_factor_ = false;
  // Iterations of conjugate gradients that take the time of a factorisation.
  int max_num_gradients_ = 0;
  MinimizeBundleSummary summary_;
  double cost_ = 0.0;
  int num_invalid_steps_ = 0;
};

}  // namespace

MinimizeBundleSummary MinimizeBundle(const MinimizeBundleOptions& options,
                                     BundleProblem* bundle) {
  return BundleMinimizer(options, bundle).Run();
}

}  // namespace adasfm
