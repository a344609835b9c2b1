// SPDX-License-Identifier: BSD-3-Clause
// The part of BundleProblem that shared_errors.h describes.
#include <ceres/normal_prior.h>

#include <cmath>
#include <memory>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"

namespace adasfm {

std::vector<double*> BundleProblem::SharedParameters(const PosePriorEdge& edge,
                                                     const PosePriorCost& cost,
                                                     PosePriorCost::Term term) {
  if (cost.parameter_block_sizes().size() == 2) return {};
  if (term == PosePriorCost::Term::kLength) {
    SharedBlock& drift = shared_[direction_drift_ + edge.windows.direction];
    drift.is_used = true;
    return {drift.values};
  }
  if (term != PosePriorCost::Term::kRotation) {
    SharedBlock& direction = shared_[kDrivingDirection];
    SharedBlock& drift = shared_[direction_drift_ + edge.windows.direction];
    direction.is_used = drift.is_used = true;
    return {direction.values, drift.values};
  }
  SharedBlock& rotation = shared_[kExtrinsicRotation];
  SharedBlock& bias = shared_[kGyroscopeBias + edge.windows.gyroscope];
  rotation.is_used = bias.is_used = true;
  return {rotation.values, bias.values};
}

void BundleProblem::AddSharedErrorPrior(double sigma, SharedBlock* block) {
  if (!block->is_used) return;
  if (!options_.shared_errors.enabled || !(sigma > 0.0)) {
    problem_->SetParameterBlockConstant(block->values);
    return;
  }
  other_costs_.push_back(std::make_unique<ceres::NormalPrior>(
      Eigen::Matrix3d::Identity() / sigma, Eigen::Vector3d::Zero()));
  problem_->AddResidualBlock(other_costs_.back().get(), nullptr, block->values);
}

void BundleProblem::AddSharedErrorStep(double sigma, double decay,
                                       SharedBlock* before,
                                       SharedBlock* block) {
  if (!options_.shared_errors.enabled || !(sigma > 0.0)) return;
  other_costs_.push_back(std::make_unique<DifferenceCost>(sigma, decay));
  problem_->AddResidualBlock(other_costs_.back().get(), nullptr, before->values,
                             block->values);
}

double* BundleProblem::ExtrinsicRotation() {
  SharedBlock& block = shared_[kExtrinsicRotation];
  if (!block.is_used) {
    block.is_used = true;
    problem_->AddParameterBlock(block.values, 3);
    AddSharedErrorPrior(options_.shared_errors.extrinsic_rotation_sigma_rad,
                        &block);
  }
  return block.values;
}

void BundleProblem::AddSharedErrorPriors(
    const std::vector<PosePriorEdge>& edges) {
  const SharedErrorOptions& shared = options_.shared_errors;
  AddSharedErrorPrior(shared.extrinsic_rotation_sigma_rad,
                      &shared_[kExtrinsicRotation]);
  AddSharedErrorPrior(shared.driving_direction_sigma_rad,
                      &shared_[kDrivingDirection]);
  AddGyroscopePriors();
  AddDirectionDriftPriors(
      shared.direction_drift_time_s > 0.0 ? MedianDirectionSigma(edges) : 0.0);
}

// A random walk: once its first value is believed, each next one only by its
// step, or a constant bias would be held back once a window.
void BundleProblem::AddGyroscopePriors() {
  const SharedErrorOptions& shared = options_.shared_errors;
  const double sigma = shared.gyroscope_bias_sigma_rad_s;
  const double step_sigma = shared.gyroscope_random_walk_rad_s_sqrt_s *
                            std::sqrt(shared.gyroscope_window_s);
  SharedBlock* before = nullptr;
  for (size_t k = kGyroscopeBias; k < direction_drift_; ++k) {
    SharedBlock& block = shared_[k];
    if (!block.is_used) continue;
    if (before == nullptr || !shared.enabled || !(sigma > 0.0) ||
        !(step_sigma > 0.0)) {
      AddSharedErrorPrior(sigma, &block);
    } else {
      AddSharedErrorStep(step_sigma, 1.0, before, &block);
    }
    before = &block;
  }
}

// A stationary process: its first value has the sigma, each next one decays
// towards zero and is stirred as much as keeps the sigma.
void BundleProblem::AddDirectionDriftPriors(double sigma_rad) {
  const SharedErrorOptions& shared = options_.shared_errors;
  const double decay =
      std::exp(-shared.direction_window_s / shared.direction_drift_time_s);
  SharedBlock* before = nullptr;
  for (size_t k = direction_drift_; k < shared_.size(); ++k) {
    SharedBlock& block = shared_[k];
    if (!block.is_used) continue;
    if (before == nullptr || !shared.enabled || !(sigma_rad > 0.0)) {
      AddSharedErrorPrior(sigma_rad, &block);
    } else {
      AddSharedErrorStep(sigma_rad * std::sqrt(1.0 - decay * decay), decay,
                         before, &block);
    }
    before = &block;
  }
}

SharedErrors BundleProblem::EstimatedSharedErrors() const {
  SharedErrors errors;
  const auto vector = [](const SharedBlock& block) {
    return Eigen::Vector3d(block.values[0], block.values[1], block.values[2]);
  };
  errors.extrinsic_rotation = vector(shared_[kExtrinsicRotation]);
  errors.driving_direction = vector(shared_[kDrivingDirection]);
  for (size_t k = kGyroscopeBias; k < shared_.size(); ++k) {
    if (!shared_[k].is_used) continue;
    if (k < direction_drift_) {
      errors.gyroscope_bias[k - kGyroscopeBias] = vector(shared_[k]);
    } else {
      errors.direction_drift[k - direction_drift_] = vector(shared_[k]);
    }
  }
  return errors;
}

}  // namespace adasfm
