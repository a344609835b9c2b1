// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_rosbag.h"

#include <algorithm>
#include <filesystem>
#include <set>

#ifdef ADASFM_HAS_ROSBAG
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "sensors/io/ros_messages.h"
#endif

namespace adasfm {
namespace {

constexpr char kExtension[] = ".bag";

// "drive.bag:/topic" in its two parts; no topic when none is given.
struct BagPath {
  std::string file;
  std::string topic;
};

BagPath SplitPath(const std::string& path) {
  const size_t colon = path.rfind(std::string(kExtension) + ":");
  if (colon == std::string::npos) return {path, ""};
  const size_t end = colon + sizeof(kExtension) - 1;
  return {path.substr(0, end), path.substr(end + 1)};
}

#ifdef ADASFM_HAS_ROSBAG

// The only topic of the type, or the given one when it is of that type.
StatusOr<std::string> FindTopic(const rosbag::Bag& bag, const BagPath& path,
                                const std::string& type) {
  rosbag::View view(bag);
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
    if (connection->datatype == type) topics.insert(connection->topic);
  }
  if (topics.empty()) {
    return Status::Error(path.file + ": no topic of type " + type);
  }
  std::string list;
  for (const std::string& topic : topics) {
    list += (list.empty() ? "" : ", ") + topic;
  }
  if (!path.topic.empty()) {
    if (topics.count(path.topic) > 0) return path.topic;
    return Status::Error(path.file + ": no topic " + path.topic + " of type " +
                         type + "; there is " + list);
  }
  if (topics.size() == 1) return *topics.begin();
  return Status::Error(path.file + ": several topics of type " + type + " (" +
                       list + "); choose one as " + path.file + ":" +
                       *topics.begin());
}

template <typename Message, typename Sample>
StatusOr<std::vector<Sample>> ReadMessages(const BagPath& path) {
  const std::string type = ros::message_traits::DataType<Message>::value();
  rosbag::Bag bag;
  bag.open(path.file, rosbag::bagmode::Read);
  const StatusOr<std::string> topic = FindTopic(bag, path, type);
  if (!topic.ok()) return topic.status();
  const auto error = [&](size_t index, const std::string& cause) {
    return Status::Error(path.file + ", message " + std::to_string(index) +
                         " of " + *topic + ": " + cause);
  };
  std::vector<Sample> samples;
  rosbag::View view(bag, rosbag::TopicQuery(*topic));
  for (const rosbag::MessageInstance& instance : view) {
    const size_t index = samples.size() + 1;
    const boost::shared_ptr<Message> message = instance.instantiate<Message>();
    if (message == nullptr) {
      return error(index, "not the " + type + " that ROS 1 knows");
    }
    Sample sample;
    const std::string cause = ConvertRosMessage(*message, &sample);
    if (!cause.empty()) return error(index, cause);
    samples.push_back(sample);
  }
  // Bags are in the order of arrival.
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) {
                     return a.timestamp_ns < b.timestamp_ns;
                   });
  return samples;
}

#else

template <typename Sample>
StatusOr<std::vector<Sample>> ReadMessages(const BagPath& path) {
  return Status::Error(path.file +
                       ": this build cannot read ROS bags; install "
                       "librosbag-storage-dev, libsensor-msgs-dev and "
                       "libnav-msgs-dev and build again");
}

#endif

// Opens what can be read at all; the library's exceptions become errors.
template <typename Read>
auto ReadBag(const std::string& text, const Read& read)
    -> decltype(read(BagPath())) {
  const BagPath path = SplitPath(text);
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path.file, ignored)) {
    return Status::Error(path.file + ": no such file");
  }
  try {
    return read(path);
  } catch (const std::exception& exception) {
    return Status::Error(path.file + ": cannot be read as a ROS 1 bag (" +
                         exception.what() +
                         "); was it closed? try rosbag reindex");
  }
}

}  // namespace

bool IsRosbagPath(const std::string& path) {
  const std::string file = SplitPath(path).file;
  const size_t length = sizeof(kExtension) - 1;
  return file.size() > length &&
         file.compare(file.size() - length, length, kExtension) == 0;
}

bool CanReadRosbags() {
#ifdef ADASFM_HAS_ROSBAG
  return true;
#else
  return false;
#endif
}

StatusOr<std::vector<ImuSample>> ReadRosbagImu(const std::string& path) {
  return ReadBag(path, [](const BagPath& bag) {
#ifdef ADASFM_HAS_ROSBAG
    return ReadMessages<sensor_msgs::Imu, ImuSample>(bag);
#else
    return ReadMessages<ImuSample>(bag);
#endif
  });
}

StatusOr<std::vector<OdometryPose>> ReadRosbagOdometry(
    const std::string& path) {
  return ReadBag(path, [](const BagPath& bag) {
#ifdef ADASFM_HAS_ROSBAG
    return ReadMessages<nav_msgs::Odometry, OdometryPose>(bag);
#else
    return ReadMessages<OdometryPose>(bag);
#endif
  });
}

}  // namespace adasfm
