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

double WeightedMedian(std::vector<WeightedValue>* values) {
  const auto is_less = [](const WeightedValue& a, const WeightedValue& b) {
    return a.value < b.value;
  };
  double half = 0.0;
  for (const WeightedValue& value : *values) half += 0.5 * value.weight;
  auto begin = values->begin();
  auto end = values->end();
  while (end - begin > 16) {
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(begin, middle, end, is_less);
    double left = 0.0;
    for (auto it = begin; it != middle; ++it) left += it->weight;
    if (left >= half) {
      end = middle;
    } else {
      half -= left;
      begin = middle;
    }
  }
  std::sort(begin, end, is_less);
  for (; begin + 1 != end; ++begin) {
    half -= begin->weight;
    if (half <= 0.0) break;
  }
  return begin->value;
}

}  // namespace adasfm
