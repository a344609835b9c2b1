// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_bag.h"

#include <memory>
#include <optional>
#include <utility>

#include "sensors/io/bag_logs.h"

namespace adasfm {
namespace {

struct BagPath {
  std::string file;
  std::string topic;
};

// "drive.bag:/topic" in its two parts; no topic when none is given.
BagPath SplitPath(const std::string& path) {
  const size_t colon = path.rfind(":/");
  if (colon == std::string::npos || !IsBag(path.substr(0, colon))) {
    return {path, ""};
  }
  return {path.substr(0, colon), path.substr(colon + 1)};
}

// Opens the bag of a log's path, finds the topic by `find`, and reads it.
template <typename Find>
StatusOr<BagLogs> ReadOneLog(const std::string& text, const Find& find,
                             const std::optional<WheelType>& wheel_type,
                             std::vector<std::string>* warnings) {
  const BagPath path = SplitPath(text);
  const StatusOr<std::unique_ptr<BagReader>> bag = OpenBag(path.file);
  if (!bag.ok()) return bag.status();
  BagTopics topics;
  const Status status = find(path, (*bag)->Topics(), &topics);
  if (!status.ok()) return status;
  std::vector<std::string> ignored;
  return ReadBagLogs(path.file, bag->get(), topics, wheel_type,
                     warnings == nullptr ? &ignored : warnings);
}

// All messages of a topic may lie in the damaged part of the file.
template <typename Sample>
StatusOr<std::vector<Sample>> RequireSamples(const std::string& path,
                                             std::vector<Sample> samples) {
  if (!samples.empty()) return samples;
  return Status::Error(path +
                       ": none of the topic's messages can be read; the bag "
                       "is cut short or damaged");
}

Status RequireTopic(const StatusOr<std::optional<BagTopic>>& found,
                    const std::string& path, const std::string& type,
                    std::optional<BagTopic>* topic) {
  if (!found.ok()) return found.status();
  if (!found->has_value()) {
    return Status::Error(path + ": no topic of type " + type);
  }
  *topic = *found;
  return Status::Ok();
}

StatusOr<BagLogs> ReadWheelLog(const std::string& path, WheelType type,
                               std::vector<std::string>* warnings) {
  const std::vector<std::string> types = WheelMessageTypes(type);
  if (types.empty()) {
    return Status::Error(
        path +
        ": no message of a bag has wheels of the calibration's "
        "wheel0/type; set it to odometry, velocity or ticks");
  }
  return ReadOneLog(
      path,
      [&](const BagPath& bag, const std::vector<BagTopic>& topics,
          BagTopics* chosen) {
        return RequireTopic(
            FindWheelTopic(bag.file, topics, bag.topic, type), bag.file,
            types[0] + ", which wheel0/type in the calibration asks for",
            &chosen->wheel);
      },
      type, warnings);
}

}  // namespace

bool IsBagPath(const std::string& path) { return IsBag(SplitPath(path).file); }

StatusOr<std::vector<ImuSample>> ReadBagImu(
    const std::string& path, std::vector<std::string>* warnings) {
  StatusOr<BagLogs> logs = ReadOneLog(
      path,
      [](const BagPath& bag, const std::vector<BagTopic>& topics,
         BagTopics* chosen) {
        return RequireTopic(FindImuTopic(bag.file, topics, bag.topic), bag.file,
                            "sensor_msgs/Imu", &chosen->imu);
      },
      std::nullopt, warnings);
  if (!logs.ok()) return logs.status();
  return RequireSamples(path, std::move(logs->imu));
}

StatusOr<std::vector<RosNavSatFix>> ReadBagGnss(
    const std::string& path, std::vector<std::string>* warnings) {
  StatusOr<BagLogs> logs = ReadOneLog(
      path,
      [](const BagPath& bag, const std::vector<BagTopic>& topics,
         BagTopics* chosen) {
        return RequireTopic(FindGnssTopic(bag.file, topics, bag.topic),
                            bag.file, "sensor_msgs/NavSatFix", &chosen->gnss);
      },
      std::nullopt, warnings);
  if (!logs.ok()) return logs.status();
  return RequireSamples(path, std::move(logs->gnss));
}

StatusOr<std::vector<OdometryPose>> ReadBagOdometry(
    const std::string& path, std::vector<std::string>* warnings) {
  StatusOr<BagLogs> logs = ReadWheelLog(path, WheelType::kOdometry, warnings);
  if (!logs.ok()) return logs.status();
  return RequireSamples(path, std::move(logs->odometry));
}

StatusOr<std::vector<WheelSample>> ReadBagWheel(
    const std::string& path, WheelType type,
    std::vector<std::string>* warnings) {
  StatusOr<BagLogs> logs = ReadWheelLog(path, type, warnings);
  if (!logs.ok()) return logs.status();
  return RequireSamples(path, std::move(logs->wheel));
}

}  // namespace adasfm
