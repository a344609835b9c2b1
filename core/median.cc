// SPDX-License-Identifier: BSD-3-Clause
#include "core/median.h"

#include <algorithm>

namespace adasfm {

double Median(std::vector<double> values) {
  const double upper = UpperMedian(&values);
  if (values.empty() || values.size() % 2 == 1) return upper;
  // UpperMedian has put the smaller half first.
  return 0.5 * (upper + *std::max_element(values.begin(),
                                          values.begin() + values.size() / 2));
}

double UpperMedian(std::vector<double>* values) {
  if (values->empty()) return 0.0;
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

}  // namespace adasfm
