// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/log_cleaning/clean_imu.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

using Log = std::vector<ImuSample>;

Log Drive(uint64_t seed = 1) {
  return BuildSyntheticWorld(SmallWorld(seed)).imu_samples;
}

// Line 1 is a header, as in the files.
LogOrigin Origin(size_t num_samples) {
  LogOrigin origin{"imu.csv", {}, "line"};
  for (size_t i = 0; i < num_samples; ++i) origin.line_numbers.push_back(i + 2);
  return origin;
}

CleanedLog<ImuSample> Clean(const Log& log) {
  StatusOr<CleanedLog<ImuSample>> cleaned = CleanImu(log, Origin(log.size()));
  if (!cleaned.ok()) throw std::runtime_error(cleaned.status().message());
  return *cleaned;
}

// Expects that exactly the samples [begin, end) are left out, as this kind.
void ExpectLeftOut(const Log& log, size_t begin, size_t end,
                   LogFaultKind kind) {
  const CleanedLog<ImuSample> cleaned = Clean(log);
  ASSERT_EQ(cleaned.faults.size(), 1u) << FaultName(kind);
  const LogFault& fault = cleaned.faults[0];
  EXPECT_EQ(FaultName(fault.kind), std::string(FaultName(kind)));
  EXPECT_EQ(fault.first, begin + 2);
  EXPECT_EQ(fault.last, end + 1);
  EXPECT_EQ(fault.num_samples, static_cast<int>(end - begin));
  EXPECT_EQ(cleaned.samples.size(), log.size() - (end - begin));
  ASSERT_EQ(cleaned.warnings.size(), 1u);
  EXPECT_NE(cleaned.warnings[0].find("imu.csv, line"), std::string::npos);
  EXPECT_NE(cleaned.warnings[0].find(std::to_string(begin + 2)),
            std::string::npos);
}

TEST(CleanImu, NamesOneSpikeOfTheGyroscope) {
  for (const double size : {1.0, 4.4, 17.0, -8.7}) {
    Log log = Drive();
    log[1500].angular_velocity.z() += size;
    ExpectLeftOut(log, 1500, 1501, LogFaultKind::kSpike);
  }
}

TEST(CleanImu, NamesOneSpikeOfTheAccelerometer) {
  for (const double size : {20.0, 160.0, -320.0, 1000.0}) {
    Log log = Drive();
    log[1500].specific_force.y() += size;
    ExpectLeftOut(log, 1500, 1501, LogFaultKind::kSpike);
  }
  for (const double size : {1e4, 1e5, 1e30, 1e308}) {
    Log log = Drive();
    log[1500].specific_force.y() = size;
    ExpectLeftOut(log, 1500, 1501, LogFaultKind::kImpossible);
  }
}

TEST(CleanImu, NamesSeveralWildSamplesInARow) {
  Random random(3);
  Log log = Drive();
  for (size_t i = 1500; i < 1507; ++i) {
    log[i].angular_velocity = random.GaussianVector(15.0);
  }
  ExpectLeftOut(log, 1500, 1507, LogFaultKind::kSpike);
}

TEST(CleanImu, FindsAHundredSpikesAndNoOtherSample) {
  const Log drive = Drive();
  Random random(7);
  Log log = drive;
  std::vector<bool> is_bad(log.size(), false);
  for (int k = 0; k < 100; ++k) {
    const size_t i = random.UniformInt(0, static_cast<int>(log.size()) - 1);
    is_bad[i] = true;
    const double size = std::pow(10.0, random.Uniform(0.0, 1.5));
    log[i].angular_velocity =
        drive[i].angular_velocity + Eigen::Vector3d(size, 0.0, 0.0);
  }
  const CleanedLog<ImuSample> cleaned = Clean(log);
  Log expected;
  for (size_t i = 0; i < log.size(); ++i) {
    if (!is_bad[i]) expected.push_back(log[i]);
  }
  ASSERT_EQ(cleaned.samples.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(cleaned.samples[i].timestamp_ns, expected[i].timestamp_ns);
  }
}

TEST(CleanImu, NamesAFrozenStretch) {
  Log log = Drive();
  for (size_t i = 1501; i < 1700; ++i) {
    log[i].angular_velocity = log[1500].angular_velocity;
    log[i].specific_force = log[1500].specific_force;
  }
  ExpectLeftOut(log, 1500, 1700, LogFaultKind::kFrozen);
}

TEST(CleanImu, NamesAFrozenGyroscope) {
  Log log = Drive();
  for (size_t i = 1501; i < 1540; ++i) {
    log[i].angular_velocity = log[1500].angular_velocity;
  }
  ExpectLeftOut(log, 1500, 1540, LogFaultKind::kFrozen);
}

TEST(CleanImu, NamesZeros) {
  for (const size_t num : {1, 10, 100}) {
    Log log = Drive();
    for (size_t i = 1500; i < 1500 + num; ++i) {
      log[i].angular_velocity.setZero();
      log[i].specific_force.setZero();
    }
    ExpectLeftOut(log, 1500, 1500 + num, LogFaultKind::kZero);
  }
  Log log = Drive();
  for (size_t i = 1500; i < 1600; ++i) log[i].angular_velocity.setZero();
  ExpectLeftOut(log, 1500, 1600, LogFaultKind::kZero);
}

TEST(CleanImu, NamesAStretchThatCameBefore) {
  Log log = Drive();
  for (size_t i = 1500; i < 1600; ++i) {
    log[i].angular_velocity = log[i - 300].angular_velocity;
    log[i].specific_force = log[i - 300].specific_force;
  }
  ExpectLeftOut(log, 1500, 1600, LogFaultKind::kDuplicated);
}

TEST(CleanImu, NamesSaturation) {
  Log log = Drive();
  size_t num_clipped = 0;
  double largest = 0.0;
  for (const ImuSample& sample : log) {
    largest = std::max(largest, sample.angular_velocity.z());
  }
  const double limit = 0.8 * largest;
  for (ImuSample& sample : log) {
    double& rate = sample.angular_velocity.z();
    num_clipped += rate > limit;
    rate = std::min(rate, limit);
  }
  ASSERT_GT(num_clipped, 10u);
  const CleanedLog<ImuSample> cleaned = Clean(log);
  EXPECT_EQ(cleaned.samples.size(), log.size() - num_clipped);
  ASSERT_FALSE(cleaned.faults.empty());
  for (const LogFault& fault : cleaned.faults) {
    EXPECT_EQ(fault.kind, LogFaultKind::kSaturated);
  }
}

TEST(CleanImu, NamesMissingSamples) {
  const Log drive = Drive();
  Random random(4);
  Log log;
  for (const ImuSample& sample : drive) {
    if (random.Uniform(0.0, 1.0) > 0.05) log.push_back(sample);
  }
  const CleanedLog<ImuSample> cleaned = Clean(log);
  EXPECT_EQ(cleaned.samples.size(), log.size());
  ASSERT_EQ(cleaned.warnings.size(), 1u);
  const size_t num_missing = drive.size() - log.size();
  EXPECT_NE(cleaned.warnings[0].find(std::to_string(num_missing) + " of " +
                                     std::to_string(drive.size())),
            std::string::npos)
      << cleaned.warnings[0];
}

TEST(CleanImu, RefusesADeadSensor) {
  Log log = Drive();
  for (ImuSample& sample : log) sample.angular_velocity.setZero();
  StatusOr<CleanedLog<ImuSample>> cleaned = CleanImu(log, Origin(log.size()));
  ASSERT_FALSE(cleaned.ok());
  EXPECT_NE(cleaned.status().message().find("the gyroscope holds the same"),
            std::string::npos);
  log = Drive();
  for (ImuSample& sample : log) sample.specific_force << 0.0, 0.0, 9.81;
  cleaned = CleanImu(log, Origin(log.size()));
  ASSERT_FALSE(cleaned.ok());
  EXPECT_NE(cleaned.status().message().find("the accelerometer holds the same"),
            std::string::npos);
}

TEST(CleanImu, RefusesMicroseconds) {
  Log log = Drive();
  for (ImuSample& sample : log) sample.timestamp_ns /= 1000;
  const auto cleaned = CleanImu(log, Origin(log.size()));
  ASSERT_FALSE(cleaned.ok());
  EXPECT_NE(cleaned.status().message().find("microseconds"), std::string::npos);
}

// Kerbs: forces of some 50 m/s^2 that ring for a few hundredths of a second,
// while the body pitches.
void AddBumps(uint64_t seed, Log* log) {
  Random random(seed);
  for (int bump = 0; bump < 20; ++bump) {
    const size_t begin =
        random.UniformInt(300, static_cast<int>(log->size()) - 100);
    const double force = random.Uniform(20.0, 80.0);
    const double rate = random.Uniform(0.2, 1.5);
    const double frequency = random.Uniform(8.0, 25.0);
    const double decay_s = random.Uniform(0.02, 0.06);
    for (size_t i = begin; i < begin + 80; ++i) {
      const double t = 0.005 * (i - begin);
      const double wave =
          std::exp(-t / decay_s) * std::sin(2.0 * EIGEN_PI * frequency * t);
      (*log)[i].specific_force.z() += force * wave;
      (*log)[i].angular_velocity.y() += rate * wave;
    }
  }
}

TEST(CleanImu, KeepsEverySampleOfHealthyDrives) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const Log log = Drive(seed);
    const CleanedLog<ImuSample> cleaned = Clean(log);
    EXPECT_TRUE(cleaned.warnings.empty()) << seed;
    EXPECT_EQ(cleaned.samples.size(), log.size());
  }
}

TEST(CleanImu, KeepsHardBumps) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Log log = Drive(seed);
    AddBumps(seed, &log);
    const CleanedLog<ImuSample> cleaned = Clean(log);
    for (const LogFault& fault : cleaned.faults) {
      std::string text;
      for (size_t i = fault.first - 10; i < fault.last + 6; ++i) {
        text += std::to_string(log[i].specific_force.z()) + " " +
                std::to_string(log[i].angular_velocity.y()) + "\n";
      }
      ADD_FAILURE() << seed << ": " << text << DescribeFaults({fault})[0];
    }
  }
}

// A quantised log at rest has hundreds of equal readings in a row.
TEST(CleanImu, KeepsQuantisedReadings) {
  Log log = Drive();
  for (ImuSample& sample : log) {
    for (int axis = 0; axis < 3; ++axis) {
      double& rate = sample.angular_velocity[axis];
      rate = 0.01 * std::round(rate / 0.01);
      double& force = sample.specific_force[axis];
      force = 0.1 * std::round(force / 0.1);
    }
  }
  EXPECT_EQ(Clean(log).samples.size(), log.size());
}

TEST(CleanImu, KeepsEverySampleOfRealLogs) {
  for (const char* name :
       {"kitti01-51", "kitti06-51", "kitti07-160", "comma2k19-ex1",
        "world-alias-300", "world-clean-300"}) {
    Dataset data;
    if (!ReadDataset(name, &data)) continue;
    const CleanedLog<ImuSample> cleaned = Clean(data.logs.imu);
    EXPECT_TRUE(cleaned.warnings.empty()) << name;
    EXPECT_EQ(cleaned.samples.size(), data.logs.imu.size()) << name;
  }
}

}  // namespace
}  // namespace adasfm
