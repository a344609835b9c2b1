// SPDX-License-Identifier: BSD-3-Clause
#include "core/median.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/random.h"

namespace adasfm {
namespace {

TEST(Median, IsWhatSortingGives) {
  EXPECT_EQ(Median({}), 0.0);
  std::vector<double> nothing;
  EXPECT_EQ(UpperMedian(&nothing), 0.0);
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    for (size_t size = 1; size <= 20; ++size) {
      std::vector<double> values;
      for (size_t k = 0; k < size; ++k) values.push_back(random.Gaussian(1.0));
      std::vector<double> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      const double upper = sorted[size / 2];
      EXPECT_EQ(Median(values),
                size % 2 == 1 ? upper : 0.5 * (upper + sorted[size / 2 - 1]));
      EXPECT_EQ(UpperMedian(&values), upper);
    }
  }
}

}  // namespace
}  // namespace adasfm
