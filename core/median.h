// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace adasfm {

// The middle value, or the mean of the middle two; 0 for no values.
double Median(std::vector<double> values);

// The middle value, or the larger of the middle two; 0 for no values. Reorders
// the values: for inner loops.
double UpperMedian(std::vector<double>* values);

// The median of the norm of three standard normal variables.
inline constexpr double kMedianNorm3 = 1.538;

struct WeightedValue {
  double value = 0.0;
  double weight = 0.0;
};

// The smallest value at which, in ascending order, half of the weight is
// reached; there must be at least one value. Reorders the values. Halves the
// range before sorting it.
double WeightedMedian(std::vector<WeightedValue>* values);

}  // namespace adasfm
