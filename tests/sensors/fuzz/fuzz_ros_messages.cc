// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>

#include "memory_file.h"
#include "sensors/io/ros_messages.h"

namespace {

// The next bytes of the input as a value; zero beyond its end.
class Bytes {
 public:
  Bytes(const uint8_t* data, size_t size) : data_(data), size_(size) {}

  template <typename T>
  Bytes& operator>>(T& value) {
    const size_t count = std::min(sizeof(T), size_);
    value = T();
    if (count > 0) std::memcpy(&value, data_, count);
    data_ += count;
    size_ -= count;
    return *this;
  }

 private:
  const uint8_t* data_;
  size_t size_;
};

}  // namespace

// The bytes are the fields of a message as ROS hands it over: what stands
// before that, its deserialisation, is not this project's.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  sensor_msgs::Imu imu;
  auto& rate = imu.angular_velocity;
  auto& force = imu.linear_acceleration;
  Bytes(data, size) >> imu.header.stamp.sec >> imu.header.stamp.nsec >>
      rate.x >> rate.y >> rate.z >> force.x >> force.y >> force.z;
  ImuSample sample;
  if (ConvertRosMessage(imu, &sample).empty()) {
    Require(sample.timestamp_ns > 0);
    Require(sample.angular_velocity.allFinite());
    Require(sample.specific_force.allFinite());
  }
  nav_msgs::Odometry odometry;
  auto& position = odometry.pose.pose.position;
  auto& q = odometry.pose.pose.orientation;
  Bytes(data, size) >> odometry.header.stamp.sec >>
      odometry.header.stamp.nsec >> position.x >> position.y >> position.z >>
      q.x >> q.y >> q.z >> q.w;
  OdometryPose pose;
  if (ConvertRosMessage(odometry, &pose).empty()) {
    Require(pose.timestamp_ns > 0);
    Require(pose.world_from_body.translation.allFinite());
    Require(std::abs(pose.world_from_body.rotation.norm() - 1.0) < 1e-9);
  }
  return 0;
}
