// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

namespace adasfm {

// The middle value, or the mean of the middle two; 0 of nothing.
double Median(std::vector<double> values);

// The middle value, or the larger of the middle two; 0 of nothing. Reorders the
// values: for inner loops.
double UpperMedian(std::vector<double>* values);

}  // namespace adasfm
