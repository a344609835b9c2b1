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
  EXPECT_FALSE(OptionChecker(&error)
                   .Positive({{"size_m", 0.5}, {"length_m", 2.0}})
                   .NotNegative({{"gap_s", 0.0}, {"time_s", -1.0}})
                   .AllHold());
  EXPECT_EQ(error, "time_s = -1 must not be negative");
  EXPECT_FALSE(OptionChecker(&error)
                   .Within(0, 1, "ratio", 1.0)
                   .Within(0, 0.5, "share", 0.75)
                   .AllHold());
  EXPECT_EQ(error, "share = 0.75 must be from 0 to 0.5");
}

TEST(OptionChecker, RefusesWhatIsNoNumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::string error;
  EXPECT_FALSE(OptionChecker("G", &error).Positive("a", nan).AllHold());
  EXPECT_FALSE(OptionChecker("G", &error).AtLeast(0, "a", nan).AllHold());
  EXPECT_FALSE(OptionChecker("G", &error).NotNegative({{"a", nan}}).AllHold());
  EXPECT_FALSE(OptionChecker("G", &error).Within(0, 1, "a", nan).AllHold());
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(OptionChecker("G", &error).Positive("a", infinity).AllHold());
  EXPECT_EQ(error, "G.a = inf must be finite");
}

}  // namespace
}  // namespace adasfm
