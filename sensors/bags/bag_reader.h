// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "core/status.h"
#include "sensors/bags/byte_reader.h"
#include "sensors/bags/ros_messages.h"

namespace adasfm {

struct BagTopic {
  std::string name;
  std::string type;  // "sensor_msgs/Imu": ROS 2's /msg/ is left out
  RosEncoding encoding = RosEncoding::kCdr;
};

// One message; its bytes are valid during the call only.
struct BagMessage {
  const BagTopic* topic = nullptr;
  ByteSpan bytes;
};

// Called with each message; an error ends the reading.
using BagVisitor = std::function<Status(const BagMessage&)>;

// A recording of messages. Its bytes are not trusted: every length is checked
// before it is used, and memory is allocated only for bytes that exist.
class BagReader {
 public:
  virtual ~BagReader() = default;

  // Topics with messages, in the order of their names.
  virtual const std::vector<BagTopic>& Topics() const = 0;

  // Visits all messages of the named topics in the order of the file. A file
  // that was cut short or is damaged is read as far as possible, with a
  // warning; for ROS 1 it is an error.
  virtual Status Read(const std::set<std::string>& topics,
                      const BagVisitor& visit,
                      std::vector<std::string>* warnings) = 0;
};

// Opens a recording: a ROS 2 .mcap or .db3 file, a rosbag2 folder, or a ROS 1
// .bag (in builds with librosbag-storage). For other paths, an error of one
// line states the cause.
StatusOr<std::unique_ptr<BagReader>> OpenBag(const std::string& path);

// Whether OpenBag accepts a path, by its name or, for a folder, by
// metadata.yaml or the bag files in it.
bool IsBag(const std::string& path);

// "sensor_msgs/Imu" of "sensor_msgs/msg/Imu".
std::string NormalizeRosType(const std::string& type);

// Puts topics in order of their names, each once.
void SortTopics(std::vector<BagTopic>* topics);

}  // namespace adasfm
