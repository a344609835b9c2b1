// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/types.h"
#include "sensors/bags/byte_reader.h"

namespace adasfm {

// The fields that are read from messages of ROS 1 and 2
// (docs/reference/formats.md), in the units and frames of the messages.

// How a bag's messages are serialised: ROS 2's CDR (either byte order, values
// aligned to their size from the beginning of the body) or ROS 1's packed
// little-endian bytes.
enum class RosEncoding { kCdr, kRos1 };

struct RosHeader {
  timestamp_t stamp_ns = 0;  // 0 when the driver did not set it
  std::string frame_id;
};

struct RosImu {
  RosHeader header;
  Eigen::Vector3d angular_velocity;     // rad/s
  Eigen::Vector3d linear_acceleration;  // m/s^2, specific force
};

// sensor_msgs Image. The pixels point into the message.
struct RosImage {
  RosHeader header;
  uint32_t height = 0;
  uint32_t width = 0;
  std::string encoding;
  bool is_big_endian = false;
  uint32_t row_bytes = 0;
  ByteSpan pixels;
};

struct RosCompressedImage {
  RosHeader header;
  std::string format;
  ByteSpan file;  // points into the message
};

struct RosCameraInfo {
  RosHeader header;
  uint32_t height = 0;
  uint32_t width = 0;
  std::string distortion_model;
  std::vector<double> distortion;
  std::array<double, 9> k{};   // of the raw image, row by row
  std::array<double, 12> p{};  // of the rectified image
  uint32_t binning_x = 0;
  uint32_t binning_y = 0;
  uint32_t roi_width = 0;  // 0: the whole image
  uint32_t roi_height = 0;
};

struct RosNavSatFix {
  RosHeader header;
  int status = 0;                               // below 0: no fix
  double latitude = 0.0;                        // deg
  double longitude = 0.0;                       // deg
  double altitude = 0.0;                        // m above the ellipsoid
  std::array<double, 9> position_covariance{};  // m^2, east north up
  int covariance_type = 0;                      // 0: unknown
};

struct RosJointState {
  RosHeader header;
  std::vector<std::string> names;
  std::vector<double> positions;   // rad
  std::vector<double> velocities;  // rad/s
};

// Linear and angular velocity in the frame of the machine, m/s and rad/s.
// Of TwistStamped, TwistWithCovarianceStamped, and in Odometry.
struct RosTwist {
  RosHeader header;
  Eigen::Vector3d linear;
  Eigen::Vector3d angular;
};

struct RosOdometry {
  RosHeader header;
  std::string child_frame_id;
  Eigen::Vector3d position;
  Eigen::Quaterniond rotation;  // as sent, not normalised
  Eigen::Vector3d linear;
  Eigen::Vector3d angular;
};

// One transform of a TFMessage: parent_from_child.
struct RosTransform {
  std::string parent;
  std::string child;
  Eigen::Vector3d translation;
  Eigen::Quaterniond rotation;  // as sent, not normalised
};

// Each reads one message; false when the bytes are not such a message (too
// short, too long, a length that does not fit), and then *message is undefined.
// ParseRosHeader ignores what follows the header.
bool ParseRosHeader(RosEncoding encoding, const ByteSpan& bytes,
                    RosHeader* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosImu* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosImage* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosCompressedImage* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosCameraInfo* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosNavSatFix* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosJointState* message);
// Of TwistStamped; TwistWithCovarianceStamped is the same with a covariance
// after it.
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosTwist* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosOdometry* message);
bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     std::vector<RosTransform>* message);

}  // namespace adasfm
