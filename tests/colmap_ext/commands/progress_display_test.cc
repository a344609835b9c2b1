// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/progress_display.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

TEST(ProgressBar, ShowsShareTimeLeftAndWork) {
  EXPECT_EQ(FormatProgressBar("rendering", 0.5, 65.0, 80),
            "[############------------]  50 %  1:05 left  rendering");
  EXPECT_EQ(FormatProgressBar("rendering", 0.25, 2500.0, 80),
            "[######------------------]  25 %  2:05:00 left  rendering");
}

TEST(ProgressBar, NoGuessWithoutGround) {
  EXPECT_EQ(FormatProgressBar("x", 0.0, 100.0, 80),
            "[------------------------]   0 %  x");
  EXPECT_EQ(FormatProgressBar("x", 0.5, 0.1, 80),
            "[############------------]  50 %  x");
  EXPECT_EQ(FormatProgressBar("x", 1.0, 100.0, 80),
            "[########################] 100 %  x");
}

TEST(ProgressBar, FitsOneLine) {
  const std::string what(200, 'w');
  EXPECT_EQ(FormatProgressBar(what, 0.5, 65.0, 40).size(), 39);
  EXPECT_EQ(FormatProgressBar(what, 0.5, 65.0, 1).size(), 1);
}

}  // namespace
}  // namespace adasfm
