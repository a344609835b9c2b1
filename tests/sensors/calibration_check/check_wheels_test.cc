// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/check_wheels.h"

#include <gtest/gtest.h>

#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

constexpr uint64_t kSeeds[] = {1, 2, 3, 4, 5};

Dataset Drive(uint64_t seed) {
  return ToDataset(BuildSyntheticWorld(SmallWorld(seed, 120)));
}

WheelCheck Check(const Dataset& data) {
  return CheckWheels(data.logs.imu,
                     ComputeWheelSpeeds(data.logs.wheel, data.calibration),
                     true, data.calibration);
}

// Each drive, modified by `change`, must be contradicted in these words.
template <typename Change>
void ExpectNamed(Change change, const std::string& words) {
  for (const uint64_t seed : kSeeds) {
    Dataset data = Drive(seed);
    change(&data);
    const std::string text = Check(data).contradiction;
    EXPECT_TRUE(!text.empty() && text.find(words) != std::string::npos)
        << "seed " << seed << ": '" << text << "'";
  }
}

TEST(CheckWheels, SaysNothingOfHealthyDrives) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const WheelCheck check = Check(Drive(seed));
    EXPECT_EQ(check.contradiction, "") << seed;
    EXPECT_TRUE(check.warnings.empty()) << seed;
  }
}

// Wheels that slip by 10 % each all the time, and spin four times.
TEST(CheckWheels, TakesWheelsOnGravel) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 150);
    options.wheel_slip_sigma = 0.1;
    options.num_wheel_slips = 4;
    const WheelCheck check = Check(ToDataset(BuildSyntheticWorld(options)));
    EXPECT_EQ(check.contradiction, "") << seed;
  }
}

TEST(CheckWheels, SaysNothingOfRealDrives) {
  for (const char* name :
       {"kitti01-51", "kitti06-51", "kitti07-160", "comma2k19-ex1",
        "world-alias-300", "world-clean-300"}) {
    Dataset data;
    if (!ReadDataset(name, &data)) continue;
    const WheelCheck check = Check(data);
    EXPECT_EQ(check.contradiction, "") << name;
    EXPECT_TRUE(check.warnings.empty()) << name;
  }
}

TEST(CheckWheels, NamesKilometresPerHour) {
  ExpectNamed(
      [](Dataset* data) {
        for (WheelSample& sample : data->logs.wheel) {
          sample.first *= 3.6;
          sample.second *= 3.6;
        }
      },
      "look like km/h");
}

TEST(CheckWheels, NamesWheelsThatCountBackwards) {
  ExpectNamed(
      [](Dataset* data) {
        for (WheelSample& sample : data->logs.wheel) {
          sample.first *= -1.0;
          sample.second *= -1.0;
        }
      },
      "count backwards");
}

// A short drive that slips half of the time must pass.
TEST(CheckWheels, TakesEightSlipsInSixteenSeconds) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 60);
    options.num_wheel_slips = 8;
    EXPECT_EQ(Check(ToDataset(BuildSyntheticWorld(options))).contradiction, "")
        << seed;
  }
}

// Wheels spin by a factor of 1.7 while a straight drive gains its speed, and
// the accelerometer observes nearly nothing else of the drive.
TEST(CheckWheels, DoesNotRefuseWheelsThatSpinAtTheStart) {
  SyntheticWorldOptions options = SmallWorld(2, 60);
  options.trajectory = SyntheticTrajectory::kStraight;
  options.num_wheel_slips = 2;
  const WheelCheck check = Check(ToDataset(BuildSyntheticWorld(options)));
  EXPECT_EQ(check.contradiction, "");
  ASSERT_EQ(check.warnings.size(), 1);
  EXPECT_NE(check.warnings[0].find("spun"), std::string::npos);
}

// Two slips in 16 s of driving: their accelerations are the largest of the log.
TEST(CheckWheels, NamesMistakesOfShortDrivesWithSlips) {
  const auto scale = [](double factor, Dataset* data) {
    for (WheelSample& sample : data->logs.wheel) {
      sample.first *= factor;
      sample.second *= factor;
    }
  };
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 60);
    options.num_wheel_slips = 2;
    const Dataset drive = ToDataset(BuildSyntheticWorld(options));
    EXPECT_EQ(Check(drive).contradiction, "") << seed;
    for (const auto& [factor, words] : {std::make_pair(-1.0, "count backwards"),
                                        std::make_pair(3.6, "like km/h")}) {
      Dataset data = drive;
      scale(factor, &data);
      const std::string text = Check(data).contradiction;
      EXPECT_NE(text.find(words), std::string::npos)
          << "seed " << seed << ": '" << text << "'";
    }
  }
}

TEST(CheckWheels, NamesATurnedWheelFrame) {
  for (const auto& [angle, words] :
       {std::make_pair(EIGEN_PI, "T_imu_wheel is turned by 180 deg"),
        std::make_pair(0.5 * EIGEN_PI, "T_imu_wheel looks turned about z")}) {
    ExpectNamed(
        [angle = angle](Dataset* data) {
          Eigen::Quaterniond& rotation =
              data->calibration.imu_from_wheel.rotation;
          rotation =
              rotation * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ());
        },
        words);
  }
}

TEST(CheckWheels, NamesTheAccelerometersSign) {
  ExpectNamed(
      [](Dataset* data) {
        for (ImuSample& sample : data->logs.imu) sample.specific_force *= -1.0;
      },
      "accelerometer has the other sign");
}

TEST(CheckWheels, NamesTheAccelerometersAxes) {
  ExpectNamed(
      [](Dataset* data) {
        for (ImuSample& sample : data->logs.imu) {
          std::swap(sample.specific_force.x(), sample.specific_force.y());
        }
      },
      "read as x = y, y = x, z = z");
  ExpectNamed(
      [](Dataset* data) {
        for (ImuSample& sample : data->logs.imu) {
          std::swap(sample.specific_force.x(), sample.specific_force.z());
        }
      },
      "read as x = z, y = y, z = x");
}

TEST(CheckWheels, NamesTheWheelsClock) {
  for (const auto& [seconds, words] :
       {std::make_pair(0.5, "-0.5 s"), std::make_pair(3.0, "-3.0 s"),
        std::make_pair(-0.7, "+0.7 s")}) {
    ExpectNamed(
        [seconds = seconds](Dataset* data) {
          for (WheelSample& sample : data->logs.wheel) {
            sample.timestamp_ns += std::llround(1e9 * seconds);
          }
        },
        words);
  }
}

// The same drive with its wheel readings in reverse order.
TEST(CheckWheels, NamesTheLogOfAnotherDrive) {
  ExpectNamed(
      [](Dataset* data) {
        const std::vector<WheelSample> log = data->logs.wheel;
        for (size_t i = 0; i < log.size(); ++i) {
          data->logs.wheel[i].first = log[log.size() - 1 - i].first;
          data->logs.wheel[i].second = log[log.size() - 1 - i].second;
        }
      },
      "");
}

TEST(CheckWheels, WarnsOfTheTrackWidth) {
  for (const uint64_t seed : kSeeds) {
    Dataset data = Drive(seed);
    data.calibration.track_width_m *= 2.0;
    const WheelCheck check = Check(data);
    EXPECT_EQ(check.contradiction, "");
    ASSERT_EQ(check.warnings.size(), 1u);
    EXPECT_NE(check.warnings[0].find("track_width"), std::string::npos);
  }
}

}  // namespace
}  // namespace adasfm
