// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "sensors/bags/ros1_bag.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"

#ifdef ADASFM_HAS_ROSBAG
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Imu.h>
#endif

namespace adasfm {
namespace {

constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;
constexpr timestamp_t kPeriodNs = 5'000'000;
constexpr int kNumMessages = 400;

class Rosbag : public testing::Test {
 protected:
  ~Rosbag() override { std::filesystem::remove(path_); }

  void ExpectImuError(const std::string& path, const std::string& words) {
    const StatusOr<std::vector<ImuSample>> imu = ReadImu(path);
    ASSERT_FALSE(imu.ok()) << words;
    EXPECT_NE(imu.status().message().find(words), std::string::npos)
        << imu.status().message();
    EXPECT_EQ(imu.status().message().find('\n'), std::string::npos);
  }

  const std::string path_ =
      testing::TempDir() + "adasfm_rosbag_test_" +
      testing::UnitTest::GetInstance()->current_test_info()->name() + ".bag";
};

TEST_F(Rosbag, MissingFilesAndOtherWheelTypesAreErrors) {
  ExpectImuError(path_, "no such file");
  const auto wheel = ReadWheel(path_, WheelType::kDifferential);
  ASSERT_FALSE(wheel.ok());
  EXPECT_NE(wheel.status().message().find("odometry"), std::string::npos);
}

#ifdef ADASFM_HAS_ROSBAG

sensor_msgs::Imu ImuMessage(int i) {
  sensor_msgs::Imu message;
  message.header.stamp.fromNSec(kStartNs + i * kPeriodNs);
  message.angular_velocity.x = 0.1;
  message.angular_velocity.y = 0.2 + 1e-3 * i;
  message.angular_velocity.z = 0.3;
  message.linear_acceleration.x = 0.5;
  message.linear_acceleration.y = -0.25;
  message.linear_acceleration.z = 9.81;
  return message;
}

nav_msgs::Odometry OdometryMessage(int i) {
  nav_msgs::Odometry message;
  message.header.stamp.fromNSec(kStartNs + i * kPeriodNs);
  message.pose.pose.position.x = 0.05 * i;
  message.pose.pose.position.y = 2.0;
  message.pose.pose.orientation.w = 0.8;
  message.pose.pose.orientation.z = 0.6;
  return message;
}

template <typename Message>
void Write(rosbag::Bag* bag, const std::string& topic, const Message& message) {
  // Messages arrive a little later than they are stamped.
  bag->write(topic, message.header.stamp + ros::Duration(0.01), message);
}

// Both topics, with messages in pairs that arrive the wrong way round.
void WriteBag(const std::string& path) {
  rosbag::Bag bag(path, rosbag::bagmode::Write);
  for (int i = 0; i < kNumMessages; ++i) {
    const ros::Time arrival = ImuMessage(i).header.stamp;
    bag.write("/imu/data", arrival, ImuMessage(i ^ 1));
    if (i % 10 == 0) Write(&bag, "/odom", OdometryMessage(i));
  }
}

TEST_F(Rosbag, GivesBackWhatWasWritten) {
  WriteBag(path_);
  for (const std::string& path : {path_, path_ + ":/imu/data"}) {
    std::vector<std::string> warnings;
    const StatusOr<std::vector<ImuSample>> imu = ReadImu(path, &warnings);
    ASSERT_TRUE(imu.ok()) << imu.status().message();
    EXPECT_TRUE(warnings.empty());
    ASSERT_EQ(imu->size(), kNumMessages);
    for (int i = 0; i < kNumMessages; ++i) {
      const ImuSample& sample = (*imu)[i];
      EXPECT_EQ(sample.timestamp_ns, kStartNs + i * kPeriodNs);
      EXPECT_EQ(sample.angular_velocity,
                Eigen::Vector3d(0.1, 0.2 + 1e-3 * i, 0.3));
      EXPECT_EQ(sample.specific_force, Eigen::Vector3d(0.5, -0.25, 9.81));
    }
  }
  const StatusOr<std::vector<OdometryPose>> odometry = ReadOdometry(path_);
  ASSERT_TRUE(odometry.ok()) << odometry.status().message();
  ASSERT_EQ(odometry->size(), kNumMessages / 10);
  const OdometryPose& pose = (*odometry)[3];
  EXPECT_EQ(pose.timestamp_ns, kStartNs + 30 * kPeriodNs);
  EXPECT_EQ(pose.world_from_body.translation, Eigen::Vector3d(1.5, 2.0, 0.0));
  EXPECT_NEAR(pose.world_from_body.rotation.z(), 0.6, 1e-12);
}

TEST_F(Rosbag, TopicsMustBeClear) {
  WriteBag(path_);
  ExpectImuError(path_ + ":/odom", "/imu/data");
  {
    rosbag::Bag bag(path_, rosbag::bagmode::Append);
    Write(&bag, "/imu/raw", ImuMessage(0));
  }
  ExpectImuError(path_, "--imu_topic /imu/data");
  EXPECT_TRUE(ReadImu(path_ + ":/imu/data").ok());
}

TEST_F(Rosbag, MistakesAreNamedWithTheirMessage) {
  const auto expect = [&](const auto& change, const std::string& words) {
    {
      rosbag::Bag bag(path_, rosbag::bagmode::Write);
      for (int i = 0; i < kNumMessages; ++i) {
        sensor_msgs::Imu message = ImuMessage(i);
        const ros::Time arrival = message.header.stamp;
        change(i, &message);
        bag.write("/imu", arrival, message);
      }
    }
    ExpectImuError(path_, words);
  };
  expect(
      [](int i, sensor_msgs::Imu* m) {
        if (i == 6) m->angular_velocity.z = std::nan("");
      },
      "message 7 of /imu");
  expect([](int, sensor_msgs::Imu* m) { m->header.stamp = ros::Time(); },
         "no stamp");
  expect([](int i, sensor_msgs::Imu* m) { *m = ImuMessage(i == 9 ? 8 : i); },
         "message 10");
  expect([](int, sensor_msgs::Imu* m) { m->linear_acceleration.z /= 9.81; },
         "m/s^2");
}

TEST_F(Rosbag, OtherFilesAndCutBagsAreErrors) {
  std::ofstream(path_) << "0,0,0,0,0,0,9.81\n";
  ExpectImuError(path_, "ROS 1 bag");
  WriteBag(path_);
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) / 2);
  ExpectImuError(path_, "ROS 1 bag");
  {
    rosbag::Bag bag(path_, rosbag::bagmode::Write);
    Write(&bag, "/odom", OdometryMessage(0));
  }
  ExpectImuError(path_, "no topic of type sensor_msgs/Imu");
}

#else

TEST_F(Rosbag, WithoutTheLibraryTheErrorSaysSo) {
  EXPECT_FALSE(CanReadRos1Bags());
  std::ofstream(path_) << "#ROSBAG V2.0\n";
  ExpectImuError(path_, "librosbag-storage-dev");
}

#endif

}  // namespace
}  // namespace adasfm
