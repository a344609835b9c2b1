// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

namespace adasfm {

// Correlation of residuals over seconds: the squares of their sums over blocks
// of time, divided by the sum of their squares. 1 for independent residuals.
class Persistence {
 public:
  void Add(double dt_s, double residual) {
    sum_ += residual;
    square_sum_ += residual * residual;
    seconds_ += dt_s;
    if (seconds_ >= kBlockS) FinishBlock();
  }
  // Ends the sum of a block, e.g. where the next link is missing.
  void FinishBlock() {
    if (seconds_ == 0.0) return;
    block_square_sum_ += sum_ * sum_;
    num_blocks_ += std::min(1.0, seconds_ / kBlockS);
    sum_ = seconds_ = 0.0;
  }
  // Few blocks are a poor estimate: 1 has the weight of kPriorBlocks blocks.
  double Ratio() const {
    if (square_sum_ <= 0.0) return 1.0;
    return std::max(
        1.0, (kPriorBlocks + num_blocks_ * block_square_sum_ / square_sum_) /
                 (kPriorBlocks + num_blocks_));
  }

 private:
  static constexpr double kBlockS = 4.0;
  static constexpr double kPriorBlocks = 4.0;

  double sum_ = 0.0;
  double seconds_ = 0.0;
  double square_sum_ = 0.0;
  double block_square_sum_ = 0.0;
  double num_blocks_ = 0.0;
};

}  // namespace adasfm
