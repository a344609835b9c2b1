// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/shared_uncertainty.h"

#include <algorithm>

namespace adasfm {

int SharedUncertainty::Column(int index) {
  constexpr int kGlobals = 2 * ChainState::kSize;
  switch (index) {
    case kScale:
      return kGlobals + ChainGlobals::kLoggedLength;
    case kDrivingYaw:
      return kGlobals + ChainGlobals::kDrivingYaw;
    case kDrivingPitch:
      return kGlobals + ChainGlobals::kDrivingPitch;
    default:
      return ChainState::kGyro + index - kGyro;
  }
}

void SharedUncertainty::Add(double dt_s, const LinkResiduals& residuals,
                            const LinkCovariance& covariance) {
  for (int i = 0; i < kSize; ++i) {
    const Eigen::VectorXd gain = residuals.jacobian * covariance.col(Column(i));
    influence_[i] += gain.dot(residuals.values);
    expected_[i] += gain.squaredNorm();
    variance_[i] = covariance(Column(i), Column(i));
  }
  block_s_ += dt_s;
  if (block_s_ >= kBlockS) FinishBlock();
}

void SharedUncertainty::FinishBlock() {
  influence2_ += influence_.square();
  expected_sum_ += expected_;
  expected2_sum_ += expected_.square();
  influence_.setZero();
  expected_.setZero();
  block_s_ = 0.0;
}

SharedUncertainty::Vector SharedUncertainty::Growth() const {
  Vector growth = Vector::Zero();
  for (int i = 0; i < kSize; ++i) {
    if (expected_sum_[i] <= 0.0 || variance_[i] <= 0.0) continue;
    const double num_blocks =
        expected_sum_[i] * expected_sum_[i] / expected2_sum_[i];
    const double excess = (influence2_[i] / expected_sum_[i] - 1.0) *
                          num_blocks / (num_blocks + kPriorBlocks);
    // The share that priors determine does not grow.
    const double share = std::min(1.0, expected_sum_[i] / variance_[i]);
    growth[i] = std::max(0.0, share * excess);
  }
  return growth;
}

}  // namespace adasfm
