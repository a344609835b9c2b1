// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/shared_error_blocks.h"

#include <ceres/normal_prior.h>

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace adasfm {

SharedErrorBlocks::SharedErrorBlocks(const SharedErrorOptions& options,
                                     const std::vector<PosePriorEdge>& edges)
    : options_(options) {
  if (options.direction_drift_time_s > 0.0) {
    direction_drift_sigma_rad_ = MedianDirectionSigma(edges);
  }
}

std::vector<double*> SharedErrorBlocks::ParametersOf(const PosePriorEdge& edge,
                                                     const PosePriorCost& cost,
                                                     PosePriorCost::Term term) {
  const size_t num_shared = cost.parameter_block_sizes().size() - 2;
  if (num_shared == 0) return {};
  const SharedErrorWindows& windows = edge.windows;
  const auto use = [&windows](int index, Blocks* blocks) {
    Block& block = (*blocks)[index];
    block.drive = windows.drive;
    return block.values;
  };
  if (term == PosePriorCost::Term::kRotation) {
    std::vector<double*> parameters = {use(windows.drive, &extrinsic_rotation_),
                                       use(windows.gyroscope, &gyroscope_bias_),
                                       use(windows.drive, &gyroscope_scale_)};
    if (parameters.size() < num_shared) {
      parameters.push_back(&time_shift_[windows.drive]);
    }
    return parameters;
  }
  std::vector<double*> parameters;
  if (term != PosePriorCost::Term::kLength) {
    parameters.push_back(use(windows.drive, &driving_direction_));
  }
  if (term != PosePriorCost::Term::kLength ||
      windows.length_per_direction > 0.0) {
    parameters.push_back(use(windows.direction, &direction_drift_));
  }
  if (parameters.size() < num_shared) {
    LengthScale& scale = length_scale_[windows.drive];
    ++scale.num_lengths;
    parameters.push_back(&scale.value);
  }
  return parameters;
}

void SharedErrorBlocks::AddPrior(double sigma, Block* block,
                                 ceres::Problem* problem) {
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

double* SharedErrorBlocks::ExtrinsicRotation(int drive,
                                             ceres::Problem* problem) {
  const auto [found, is_new] = extrinsic_rotation_.emplace(drive, Block());
  Block& block = found->second;
  if (is_new) {
    block.drive = drive;
    problem->AddParameterBlock(block.values, 3);
    AddPrior(options_.extrinsic_rotation_sigma_rad, &block, problem);
  }
  return block.values;
}

void SharedErrorBlocks::AddPriors(ceres::Problem* problem) {
  for (auto& [key, block] : extrinsic_rotation_) {
    AddPrior(options_.extrinsic_rotation_sigma_rad, &block, problem);
  }
  for (auto& [key, block] : gyroscope_scale_) {
    AddPrior(kGyroscopeScaleSigma, &block, problem);
  }
  for (auto& [key, block] : driving_direction_) {
    AddPrior(options_.driving_direction_sigma_rad, &block, problem);
  }
  AddGyroscopePriors(problem);
  AddDirectionDriftPriors(problem);
  AddLengthScalePriors(problem);
  AddTimeShiftPriors(problem);
}

// A random walk in each drive: the first value has a prior, each later value
// only a prior on its step. Priors on all values would penalise a constant bias
// once a window.
void SharedErrorBlocks::AddGyroscopePriors(ceres::Problem* problem) {
  const double step_sigma = options_.gyroscope_random_walk_rad_s_sqrt_s *
                            std::sqrt(options_.gyroscope_window_s);
  std::map<int, Block*> last_of_drive;
  for (auto& [key, block] : gyroscope_bias_) {
    Block*& before = last_of_drive[block.drive];
    if (!options_.enabled || before == nullptr || !(step_sigma > 0.0)) {
      AddPrior(kGyroscopeBiasSigmaRadS, &block, problem);
    } else {
      AddStep(step_sigma, 1.0, before, &block, problem);
    }
    before = &block;
  }
}

// A stationary process in each drive: the first value has the sigma; each later
// value decays towards zero, with process noise that keeps the sigma.
void SharedErrorBlocks::AddDirectionDriftPriors(ceres::Problem* problem) {
  const double sigma = direction_drift_sigma_rad_;
  const double decay =
      std::exp(-kDirectionWindowS / options_.direction_drift_time_s);
  std::map<int, Block*> last_of_drive;
  for (auto& [key, block] : direction_drift_) {
    Block*& before = last_of_drive[block.drive];
    if (!options_.enabled || before == nullptr || !(sigma > 0.0)) {
      AddPrior(sigma, &block, problem);
    } else {
      AddStep(sigma * std::sqrt(1.0 - decay * decay), decay, before, &block,
              problem);
    }
    before = &block;
  }
}

// The mean of all lengths keeps its scale: an unknown factor of all residuals
// would shrink with them.
void SharedErrorBlocks::AddLengthScalePriors(ceres::Problem* problem) {
  constexpr double kMeanSigma = 1e-6;
  constexpr double kSigma = 0.01;  // Relative, of the scale of one drive.
  if (length_scale_.empty()) return;
  if (!options_.enabled) {
    for (auto& [drive, scale] : length_scale_) {
      problem->SetParameterBlockConstant(&scale.value);
    }
    return;
  }
  int num_lengths = 0;
  for (auto& [drive, scale] : length_scale_) num_lengths += scale.num_lengths;
  std::vector<double*> values;
  std::vector<double> shares;
  for (auto& [drive, scale] : length_scale_) {
    AddSumPrior(kSigma, {1.0}, {&scale.value}, problem);
    values.push_back(&scale.value);
    shares.push_back(1.0 * scale.num_lengths / num_lengths);
  }
  AddSumPrior(kMeanSigma, std::move(shares), values, problem);
}

void SharedErrorBlocks::AddTimeShiftPriors(ceres::Problem* problem) {
  // The import corrects what two views show clearly; cameras are often off by
  // tens of milliseconds.
  constexpr double kSigmaS = 0.02;
  for (auto& [drive, shift] : time_shift_) {
    if (options_.enabled) {
      AddSumPrior(kSigmaS, {1.0}, {&shift}, problem);
    } else {
      problem->SetParameterBlockConstant(&shift);
    }
  }
}

void SharedErrorBlocks::AddSumPrior(double sigma, std::vector<double> weights,
                                    const std::vector<double*>& values,
                                    ceres::Problem* problem) {
  costs_.push_back(
      std::make_unique<WeightedSumCost>(sigma, std::move(weights)));
  problem->AddResidualBlock(costs_.back().get(), nullptr, values);
}

std::vector<double*> SharedErrorBlocks::Used() {
  std::vector<double*> used;
  for (Blocks* blocks :
       {&extrinsic_rotation_, &gyroscope_scale_, &driving_direction_,
        &gyroscope_bias_, &direction_drift_}) {
    for (auto& [key, block] : *blocks) used.push_back(block.values);
  }
  for (auto& [drive, scale] : length_scale_) used.push_back(&scale.value);
  for (auto& [drive, shift] : time_shift_) used.push_back(&shift);
  return used;
}

SharedErrors SharedErrorBlocks::Estimated() const {
  const auto values_of = [](const Blocks& blocks) {
    std::map<int, Eigen::Vector3d> values;
    for (const auto& [key, block] : blocks) {
      values.emplace(key, Eigen::Vector3d(block.values));
    }
    return values;
  };
  SharedErrors errors;
  errors.extrinsic_rotation = values_of(extrinsic_rotation_);
  errors.gyroscope_scale = values_of(gyroscope_scale_);
  errors.driving_direction = values_of(driving_direction_);
  errors.gyroscope_bias = values_of(gyroscope_bias_);
  errors.direction_drift = values_of(direction_drift_);
  for (const auto& [drive, scale] : length_scale_) {
    errors.length_scale.emplace(drive, scale.value);
  }
  errors.time_shift = time_shift_;
  return errors;
}

}  // namespace adasfm
