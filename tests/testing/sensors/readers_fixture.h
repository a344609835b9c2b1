// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

class Readers : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = testing::TempDir() + "adasfm_" + info->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = folder_ + "/" + name;
    std::filesystem::create_directories(
        std::filesystem::path(path).parent_path());
    std::ofstream(path) << text;
    return path;
  }

  std::string folder_;
};

// The message must contain all words and the file's name, and have one line.
inline void ExpectError(const Status& status, const std::string& path,
                        const std::vector<std::string>& words) {
  ASSERT_FALSE(status.ok());
  const std::string message = status.message();
  EXPECT_NE(message.find(path), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  for (const std::string& word : words) {
    EXPECT_NE(message.find(word), std::string::npos)
        << "no '" << word << "' in: " << message;
  }
}

// A sensors.yaml with a camera, an IMU and wheels.
inline const char kCalibration[] = R"(cam0:
  T_cam_imu:
    - [0, -1, 0, 0.1]
    - [0, 0, -1, 0.2]
    - [1, 0, 0, 0.3]
    - [0, 0, 0, 1]
  timeshift_cam_imu: 0.0623
imu0:
  update_rate: 200.0
  gyroscope_noise_density: 5.0e-4
  gyroscope_random_walk: 2.0e-5
  accelerometer_noise_density: 5.0e-3
  accelerometer_random_walk: 2.0e-4
wheel0:
  type: differential
  track_width: 1.2
  speed_noise: 0.05
  T_imu_wheel: [[1, 0, 0, 0], [0, 1, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]]
)";

}  // namespace adasfm
