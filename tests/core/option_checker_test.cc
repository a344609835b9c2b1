// SPDX-License-Identifier: BSD-3-Clause
#include "core/option_checker.h"

#include <gtest/gtest.h>

#include <limits>

namespace adasfm {
namespace {

TEST(OptionChecker, NamesTheFirstOptionThatBreaksItsRule) {
  std::string error;
  EXPECT_TRUE(OptionChecker("AdaSfmGroup", &error)
                  .Positive("size_m", 1e-3)
                  .AtLeast(2, "num_images", 2)
                  .AllHold());
  EXPECT_EQ(error, "");
  EXPECT_FALSE(OptionChecker("AdaSfmGroup", &error)
                   .Positive("size_m", 0.5)
                   .AtLeast(2, "num_images", 1)
                   .Positive("other", -1.0)
                   .AllHold());
  EXPECT_EQ(error, "AdaSfmGroup.num_images = 1 must be at least 2");
  EXPECT_FALSE(OptionChecker("AdaSfmGroup", &error)
                   .Require(false, "ratio", 1.5, "must be in [0, 1]")
                   .AllHold());
  EXPECT_EQ(error, "AdaSfmGroup.ratio = 1.5 must be in [0, 1]");
}

TEST(OptionChecker, RefusesWhatIsNoNumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::string error;
  EXPECT_FALSE(OptionChecker("G", &error).Positive("a", nan).AllHold());
  EXPECT_FALSE(OptionChecker("G", &error).AtLeast(0, "a", nan).AllHold());
}

}  // namespace
}  // namespace adasfm
