// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/clean_wheel.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

using Log = std::vector<WheelSample>;

Log Drive(uint64_t seed = 1, int num_slips = 0) {
  SyntheticWorldOptions options = SmallWorld(seed);
  options.num_wheel_slips = num_slips;
  return BuildSyntheticWorld(options).wheel_samples;
}

CleanedLog<WheelSample> Clean(const Log& log) {
  const LogOrigin origin = LogOrigin::Numbered("wheel.csv", log.size(), "line");
  const StatusOr<CleanedLog<WheelSample>> cleaned =
      CleanWheel(log, WheelType::kDifferential, origin);
  if (!cleaned.ok()) throw std::runtime_error(cleaned.status().message());
  return *cleaned;
}

// A sample at which the machine is moving.
size_t UnderWay(const Log& log) {
  size_t i = log.size() / 2;
  while (log[i].first < 3.0) ++i;
  return i;
}

void ExpectLeftOut(const Log& log, size_t begin, size_t end,
                   LogFaultKind kind) {
  const CleanedLog<WheelSample> cleaned = Clean(log);
  ASSERT_EQ(cleaned.faults.size(), 1u) << FaultName(kind);
  EXPECT_EQ(cleaned.faults[0].kind, kind);
  EXPECT_EQ(cleaned.faults[0].first, begin + 1);
  EXPECT_EQ(cleaned.faults[0].last, end);
}

TEST(CleanWheel, NamesSpikes) {
  for (const double size : {5.0, 60.0, -30.0}) {
    Log log = Drive();
    const size_t i = UnderWay(log);
    log[i].second += size;
    ExpectLeftOut(log, i, i + 1, LogFaultKind::kSpike);
  }
}

TEST(CleanWheel, NamesWheelsThatDropToZero) {
  Log log = Drive();
  const size_t begin = UnderWay(log);
  for (size_t i = begin; i < begin + 25; ++i) log[i].first = 0.0;
  ExpectLeftOut(log, begin, begin + 25, LogFaultKind::kZero);
}

TEST(CleanWheel, NamesFrozenSpeeds) {
  Log log = Drive();
  const size_t begin = UnderWay(log);
  for (size_t i = begin + 1; i < begin + 50; ++i) {
    log[i].first = log[begin].first;
    log[i].second = log[begin].second;
  }
  ExpectLeftOut(log, begin, begin + 50, LogFaultKind::kFrozen);
}

TEST(CleanWheel, KeepsHealthyDrivesWithStandstillsAndSlips) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const Log log = Drive(seed, 2);
    const CleanedLog<WheelSample> cleaned = Clean(log);
    EXPECT_EQ(cleaned.samples.size(), log.size()) << seed;
    EXPECT_TRUE(cleaned.warnings.empty());
  }
}

TEST(CleanWheel, KeepsEverySampleOfRealLogs) {
  for (const char* name :
       {"kitti01-51", "kitti06-51", "kitti07-160", "comma2k19-ex1",
        "world-alias-300", "world-clean-300"}) {
    Dataset data;
    if (!ReadDataset(name, &data)) continue;
    EXPECT_EQ(Clean(data.logs.wheel).samples.size(), data.logs.wheel.size())
        << name;
  }
}

}  // namespace
}  // namespace adasfm
