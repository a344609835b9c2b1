// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/bag_topics.h"

#include <algorithm>

namespace adasfm {
namespace {

using Types = std::vector<std::string>;

bool IsOneOf(const BagTopic& topic, const Types& types) {
  return std::find(types.begin(), types.end(), topic.type) != types.end();
}

std::string Join(const Types& words, const char* separator) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : separator) + word;
  }
  return text;
}

std::string ListTopics(const std::vector<BagTopic>& topics) {
  Types words;
  for (const BagTopic& topic : topics) {
    words.push_back(topic.name + " (" + topic.type + ")");
  }
  return words.empty() ? "no topic with ROS messages" : Join(words, ", ");
}

// "/camera" of "/camera/image_raw" and of "/camera/image_raw/compressed".
std::string CameraNamespace(const BagTopic& image) {
  std::string name = image.name;
  const auto drop_last = [&name] {
    const size_t slash = name.rfind('/');
    name.erase(slash == std::string::npos ? 0 : slash);
  };
  if (image.type == "sensor_msgs/CompressedImage") drop_last();
  drop_last();
  return name;
}

std::optional<BagTopic> FindCameraInfo(const std::vector<BagTopic>& topics,
                                       const BagTopic& image) {
  std::vector<BagTopic> infos;
  for (const BagTopic& topic : topics) {
    if (!IsOneOf(topic, {"sensor_msgs/CameraInfo"})) continue;
    if (topic.name == CameraNamespace(image) + "/camera_info") return topic;
    infos.push_back(topic);
  }
  if (infos.size() == 1) return infos[0];
  return std::nullopt;
}

}  // namespace

Types WheelMessageTypes(WheelType type) {
  switch (type) {
    case WheelType::kOdometry:
      return {"nav_msgs/Odometry"};
    case WheelType::kVelocity:
    case WheelType::kSpeed:
      return {"geometry_msgs/TwistStamped",
              "geometry_msgs/TwistWithCovarianceStamped", "nav_msgs/Odometry"};
    case WheelType::kTicks:
      return {"sensor_msgs/JointState"};
    case WheelType::kDifferential:
    case WheelType::kEncoder:
    case WheelType::kSteering:
      break;
  }
  return {};
}

StatusOr<std::optional<BagTopic>> FindBagTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const Types& types, const std::string& name, const std::string& option) {
  if (name == kNoBagTopic) return std::optional<BagTopic>();
  std::vector<BagTopic> fitting;
  for (const BagTopic& topic : topics) {
    if (IsOneOf(topic, types)) fitting.push_back(topic);
  }
  const std::string type_list = Join(types, " or ");
  if (!name.empty()) {
    for (const BagTopic& topic : fitting) {
      if (topic.name == name) return std::optional<BagTopic>(topic);
    }
    return Status::Error(bag_path + ": no topic " + name + " of type " +
                         type_list + "; the bag has " +
                         ListTopics(fitting.empty() ? topics : fitting));
  }
  if (fitting.empty()) return std::optional<BagTopic>();
  if (fitting.size() == 1) return std::optional<BagTopic>(fitting[0]);
  return Status::Error(bag_path + ": several topics of type " + type_list +
                       ": " + ListTopics(fitting) + "; choose one with " +
                       option + " " + fitting[0].name);
}

StatusOr<std::optional<BagTopic>> FindImuTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name) {
  return FindBagTopic(bag_path, topics, {"sensor_msgs/Imu"}, name,
                      "--imu_topic");
}

StatusOr<std::optional<BagTopic>> FindGnssTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name) {
  return FindBagTopic(bag_path, topics, {"sensor_msgs/NavSatFix"}, name,
                      "--gnss_topic");
}

StatusOr<std::optional<BagTopic>> FindWheelTopic(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const std::string& name, const std::optional<WheelType>& wheel_type) {
  const char* option = "--wheel_topic";
  if (wheel_type.has_value()) {
    return FindBagTopic(bag_path, topics, WheelMessageTypes(*wheel_type), name,
                        option);
  }
  // Joint states may be those of an arm: used only where there is no other
  // type.
  const Types motions = WheelMessageTypes(WheelType::kVelocity);
  const Types joints = WheelMessageTypes(WheelType::kTicks);
  if (!name.empty()) {
    Types all = motions;
    all.insert(all.end(), joints.begin(), joints.end());
    return FindBagTopic(bag_path, topics, all, name, option);
  }
  const auto topic = FindBagTopic(bag_path, topics, motions, name, option);
  if (!topic.ok() || topic->has_value()) return topic;
  return FindBagTopic(bag_path, topics, joints, name, option);
}

StatusOr<BagTopics> FindDriveTopics(
    const std::string& bag_path, const std::vector<BagTopic>& topics,
    const BagTopicNames& names, const std::optional<WheelType>& wheel_type) {
  BagTopics chosen;
  const auto image = FindBagTopic(
      bag_path, topics, {"sensor_msgs/Image", "sensor_msgs/CompressedImage"},
      names.image, "--image_topic");
  if (!image.ok()) return image.status();
  if (!image->has_value()) {
    return Status::Error(bag_path +
                         ": no topic of type sensor_msgs/Image or "
                         "sensor_msgs/CompressedImage, so no photos; the bag "
                         "has " +
                         ListTopics(topics));
  }
  chosen.image = *image;
  chosen.camera_info = FindCameraInfo(topics, **image);
  const auto imu = FindImuTopic(bag_path, topics, names.imu);
  if (!imu.ok()) return imu.status();
  chosen.imu = *imu;
  const auto wheel = FindWheelTopic(bag_path, topics, names.wheel, wheel_type);
  if (!wheel.ok()) return wheel.status();
  chosen.wheel = *wheel;
  const auto gnss = FindGnssTopic(bag_path, topics, names.gnss);
  if (!gnss.ok()) return gnss.status();
  chosen.gnss = *gnss;
  return chosen;
}

}  // namespace adasfm
