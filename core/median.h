// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace adasfm {

// The middle value, or the mean of the middle two; 0 of nothing.
double Median(std::vector<double> values);

// The middle value, or the larger of the middle two; 0 of nothing. Reorders the
// values: for inner loops.
double UpperMedian(std::vector<double>* values);

// Of the norm of three standard normal variables.
inline constexpr double kMedianNorm3 = 1.538;

struct WeightedValue {
  double value = 0.0;
  double weight = 0.0;
};

// The first value, in ascending order, at which half of the weight is reached;
// there must be one. Reorders the values. Halves the range around it while that
// pays.
double WeightedMedian(std::vector<WeightedValue>* values);

}  // namespace adasfm
