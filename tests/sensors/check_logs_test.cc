// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/check_logs.h"

#include <gtest/gtest.h>

#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

StatusOr<PriorEstimate> Estimate(const Dataset& data) {
  return EstimatePriors(data.images, data.logs, data.calibration, {}, {});
}

Dataset Drive() { return ToDataset(BuildSyntheticWorld(SmallWorld(1))); }

TEST(CheckLogs, RefusesWheelsThatCoverNoImage) {
  Dataset data = Drive();
  for (WheelSample& sample : data.logs.wheel) {
    sample.timestamp_ns += 3600'000'000'000;
  }
  StatusOr<PriorEstimate> estimate = Estimate(data);
  ASSERT_FALSE(estimate.ok());
  EXPECT_NE(estimate.status().message().find("covers no image"),
            std::string::npos);
  data = Drive();
  data.logs.wheel.resize(1);
  EXPECT_FALSE(Estimate(data).ok());
}

TEST(CheckLogs, WarnsOfWheelsThatCoverFewImages) {
  Dataset data = Drive();
  data.logs.wheel.resize(data.logs.wheel.size() / 3);
  const StatusOr<PriorEstimate> estimate = Estimate(data);
  ASSERT_TRUE(estimate.ok()) << estimate.status().message();
  ASSERT_FALSE(estimate->summary.warnings.empty());
  EXPECT_NE(estimate->summary.warnings[0].find("the wheel log covers"),
            std::string::npos);
}

TEST(CheckLogs, RefusesImagesInMicroseconds) {
  const std::vector<timestamp_t> times_ns = {0, 200'000, 400'000, 600'000};
  std::vector<std::string> warnings;
  const Status status = CheckCoverage(times_ns, MotionLogs(), &warnings);
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find("microseconds"), std::string::npos);
}

TEST(CheckLogs, NamesAWheelScaleFarFromOne) {
  bool is_error = true;
  EXPECT_EQ(DescribeWheelScale(1.1, &is_error), "");
  EXPECT_FALSE(is_error);
  EXPECT_NE(DescribeWheelScale(1.4, &is_error).find("radius"),
            std::string::npos);
  EXPECT_FALSE(is_error);
  EXPECT_NE(DescribeWheelScale(0.305, &is_error).find("km/h"),
            std::string::npos);
  EXPECT_TRUE(is_error);
  EXPECT_NE(DescribeWheelScale(45.0, &is_error), "");
  EXPECT_TRUE(is_error);
}

}  // namespace
}  // namespace adasfm
