// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/shared_error_blocks.h"

#include <ceres/normal_prior.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace adasfm {

SharedErrorBlocks::SharedErrorBlocks(const SharedErrorOptions& options,
                                     const std::vector<PosePriorEdge>& edges)
    : options_(options) {
  SharedErrorWindows last;
  for (const PosePriorEdge& edge : edges) {
    last.gyroscope = std::max(last.gyroscope, edge.windows.gyroscope);
    last.direction = std::max(last.direction, edge.windows.direction);
  }
  direction_drift_ = kGyroscopeBias + last.gyroscope + 1;
  blocks_.resize(direction_drift_ + last.direction + 1);
  if (options.direction_drift_time_s > 0.0) {
    direction_drift_sigma_rad_ = MedianDirectionSigma(edges);
  }
}

std::vector<double*> SharedErrorBlocks::ParametersOf(const PosePriorEdge& edge,
                                                     const PosePriorCost& cost,
                                                     PosePriorCost::Term term) {
  if (cost.parameter_block_sizes().size() == 2) return {};
  if (term == PosePriorCost::Term::kLength) {
    Block& drift = blocks_[direction_drift_ + edge.windows.direction];
    drift.is_used = true;
    return {drift.values};
  }
  if (term != PosePriorCost::Term::kRotation) {
    Block& direction = blocks_[kDrivingDirection];
    Block& drift = blocks_[direction_drift_ + edge.windows.direction];
    direction.is_used = drift.is_used = true;
    return {direction.values, drift.values};
  }
  Block& rotation = blocks_[kExtrinsicRotation];
  Block& bias = blocks_[kGyroscopeBias + edge.windows.gyroscope];
  rotation.is_used = bias.is_used = true;
  return {rotation.values, bias.values};
}

void SharedErrorBlocks::AddPrior(double sigma, Block* block,
                                 ceres::Problem* problem) {
  if (!block->is_used) return;
  if (!options_.enabled || !(sigma > 0.0)) {
    problem->SetParameterBlockConstant(block->values);
    return;
  }
  costs_.push_back(std::make_unique<ceres::NormalPrior>(
      Eigen::Matrix3d::Identity() / sigma, Eigen::Vector3d::Zero()));
  problem->AddResidualBlock(costs_.back().get(), nullptr, block->values);
}

void SharedErrorBlocks::AddStep(double sigma, double decay, Block* before,
                                Block* block, ceres::Problem* problem) {
  if (!options_.enabled || !(sigma > 0.0)) return;
  costs_.push_back(std::make_unique<DifferenceCost>(sigma, decay));
  problem->AddResidualBlock(costs_.back().get(), nullptr, before->values,
                            block->values);
}

double* SharedErrorBlocks::ExtrinsicRotation(ceres::Problem* problem) {
  Block& block = blocks_[kExtrinsicRotation];
  if (!block.is_used) {
    block.is_used = true;
    problem->AddParameterBlock(block.values, 3);
    AddPrior(options_.extrinsic_rotation_sigma_rad, &block, problem);
  }
  return block.values;
}

void SharedErrorBlocks::AddPriors(ceres::Problem* problem) {
  AddPrior(options_.extrinsic_rotation_sigma_rad, &blocks_[kExtrinsicRotation],
           problem);
  AddPrior(options_.driving_direction_sigma_rad, &blocks_[kDrivingDirection],
           problem);
  AddGyroscopePriors(problem);
  AddDirectionDriftPriors(problem);
}

// A random walk: the first value has a prior, each later value only a prior on
// its step. Priors on all values would penalise a constant bias once a window.
void SharedErrorBlocks::AddGyroscopePriors(ceres::Problem* problem) {
  const double sigma = options_.gyroscope_bias_sigma_rad_s;
  const double step_sigma = options_.gyroscope_random_walk_rad_s_sqrt_s *
                            std::sqrt(options_.gyroscope_window_s);
  Block* before = nullptr;
  for (size_t k = kGyroscopeBias; k < direction_drift_; ++k) {
    Block& block = blocks_[k];
    if (!block.is_used) continue;
    if (before == nullptr || !options_.enabled || !(sigma > 0.0) ||
        !(step_sigma > 0.0)) {
      AddPrior(sigma, &block, problem);
    } else {
      AddStep(step_sigma, 1.0, before, &block, problem);
    }
    before = &block;
  }
}

// A stationary process: the first value has the sigma; each later value decays
// towards zero, with process noise that keeps the sigma.
void SharedErrorBlocks::AddDirectionDriftPriors(ceres::Problem* problem) {
  const double sigma = direction_drift_sigma_rad_;
  const double decay =
      std::exp(-options_.direction_window_s / options_.direction_drift_time_s);
  Block* before = nullptr;
  for (size_t k = direction_drift_; k < blocks_.size(); ++k) {
    Block& block = blocks_[k];
    if (!block.is_used) continue;
    if (before == nullptr || !options_.enabled || !(sigma > 0.0)) {
      AddPrior(sigma, &block, problem);
    } else {
      AddStep(sigma * std::sqrt(1.0 - decay * decay), decay, before, &block,
              problem);
    }
    before = &block;
  }
}

std::vector<double*> SharedErrorBlocks::Used() {
  std::vector<double*> used;
  for (Block& block : blocks_) {
    if (block.is_used) used.push_back(block.values);
  }
  return used;
}

SharedErrors SharedErrorBlocks::Estimated() const {
  SharedErrors errors;
  const auto vector = [](const Block& block) {
    return Eigen::Vector3d(block.values[0], block.values[1], block.values[2]);
  };
  errors.extrinsic_rotation = vector(blocks_[kExtrinsicRotation]);
  errors.driving_direction = vector(blocks_[kDrivingDirection]);
  for (size_t k = kGyroscopeBias; k < blocks_.size(); ++k) {
    if (!blocks_[k].is_used) continue;
    if (k < direction_drift_) {
      errors.gyroscope_bias[k - kGyroscopeBias] = vector(blocks_[k]);
    } else {
      errors.direction_drift[k - direction_drift_] = vector(blocks_[k]);
    }
  }
  return errors;
}

}  // namespace adasfm
