// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/capture_order.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

TEST(OrderByCapture, NumbersInNamesCountAsNumbers) {
  bool by_time = true;
  EXPECT_EQ(OrderByCapture({{1, "b/2.png", {}},
                            {2, "a/10.png", {}},
                            {3, "a/9.png", {}},
                            {4, "a/09x.png", {}}},
                           &by_time),
            (std::vector<image_t>{3, 4, 2, 1}));
  EXPECT_FALSE(by_time);
}

TEST(OrderByCapture, TimesComeFirstWhereAllImagesHaveOne) {
  bool by_time = false;
  EXPECT_EQ(
      OrderByCapture({{1, "1", 30}, {2, "2", 10}, {3, "3", 20}}, &by_time),
      (std::vector<image_t>{2, 3, 1}));
  EXPECT_TRUE(by_time);
  EXPECT_EQ(OrderByCapture({{1, "1", 30}, {2, "2", {}}, {3, "3", 20}}),
            (std::vector<image_t>{1, 2, 3}));
  EXPECT_TRUE(OrderByCapture({}).empty());
}

}  // namespace
}  // namespace adasfm
