// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/bag_logs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace adasfm {
namespace {

constexpr char kStaticTransforms[] = "/tf_static";
// Largest rounding error of the length of a quaternion.
constexpr double kMaxNormError = 0.01;

std::string WithoutSlash(const std::string& frame) {
  return !frame.empty() && frame[0] == '/' ? frame.substr(1) : frame;
}

// Each returns what is wrong with the message, an empty text when the sample is
// good.

std::string Convert(const RosImu& message, ImuSample* sample) {
  sample->angular_velocity = message.angular_velocity;
  sample->specific_force = message.linear_acceleration;
  const bool is_finite = sample->angular_velocity.allFinite() &&
                         sample->specific_force.allFinite();
  return is_finite ? "" : "its rates or accelerations are not finite";
}

std::string Convert(const RosOdometry& message, OdometryPose* pose) {
  // Also false for NaN.
  const bool is_unit = std::abs(message.rotation.norm() - 1.0) < kMaxNormError;
  if (!is_unit) return "the length of its quaternion is not 1";
  if (!message.position.allFinite()) return "its position is not finite";
  pose->world_from_body =
      Rigid3d(message.rotation.normalized(), message.position);
  return "";
}

std::string Convert(const Eigen::Vector3d& linear,
                    const Eigen::Vector3d& angular, WheelSample* sample) {
  sample->first = linear.x();
  sample->second = angular.z();
  const bool is_finite =
      std::isfinite(sample->first) && std::isfinite(sample->second);
  return is_finite ? "" : "its velocity is not finite";
}

// The one joint whose name contains the word; -1 when there is none, or
// several.
int FindJoint(const std::vector<std::string>& names, const std::string& word) {
  int found = -1;
  for (size_t i = 0; i < names.size(); ++i) {
    if (names[i].find(word) == std::string::npos) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(i);
  }
  return found;
}

std::string Convert(const RosJointState& message, WheelSample* sample) {
  const int left = FindJoint(message.names, "left");
  const int right = FindJoint(message.names, "right");
  if (left < 0 || right < 0) {
    std::string list;
    for (const std::string& name : message.names) {
      list += (list.empty() ? "" : ", ") + name;
    }
    return "of its joints (" + list.substr(0, 200) +
           ") there must be one 'left' and one 'right' wheel; leave the "
           "wheels out with --wheel_topic none, or give a log of ticks";
  }
  const int num_positions = static_cast<int>(message.positions.size());
  if (left >= num_positions || right >= num_positions) {
    return "its wheels have no positions";
  }
  sample->first = message.positions[left];
  sample->second = message.positions[right];
  const bool is_finite =
      std::isfinite(sample->first) && std::isfinite(sample->second);
  return is_finite ? "" : "its positions are not finite";
}

// Collects the messages of one bag.
class LogCollector {
 public:
  LogCollector(const BagTopics& topics, WheelType wheel_type, BagLogs* logs)
      : topics_(topics), wheel_type_(wheel_type), logs_(logs) {}

  // Returns what is wrong with the message, or nothing.
  std::string Add(const BagMessage& message) {
    if (message.topic->name == kStaticTransforms) return AddTransforms(message);
    if (Is(topics_.imu, message)) return AddImu(message);
    if (Is(topics_.wheel, message)) return AddWheel(message);
    if (Is(topics_.image, message)) return AddImage(message);
    if (Is(topics_.camera_info, message)) return AddCameraInfo(message);
    if (Is(topics_.gnss, message)) return AddGnss(message);
    return "";
  }

 private:
  static bool Is(const std::optional<BagTopic>& topic,
                 const BagMessage& message) {
    return topic.has_value() && topic->name == message.topic->name &&
           topic->type == message.topic->type;
  }

  template <typename Message>
  static std::string Parse(const BagMessage& bytes, Message* message) {
    if (ParseRosMessage(bytes.topic->encoding, bytes.bytes, message)) return "";
    return "its bytes are not a " + bytes.topic->type + " that ROS knows";
  }

  // Parses a message with a header and keeps its frame.
  template <typename Message>
  static std::string ParseStamped(const BagMessage& bytes, Message* message,
                                  std::string* frame) {
    const std::string cause = Parse(bytes, message);
    if (!cause.empty()) return cause;
    return CheckHeader(message->header, frame);
  }

  static std::string CheckHeader(const RosHeader& header, std::string* frame) {
    if (header.stamp_ns <= 0) {
      return "its header has no stamp; let the driver set it";
    }
    if (frame->empty()) *frame = WithoutSlash(header.frame_id);
    return "";
  }

  std::string AddImu(const BagMessage& bytes) {
    RosImu message;
    std::string cause = ParseStamped(bytes, &message, &logs_->imu_frame);
    if (!cause.empty()) return cause;
    ImuSample sample;
    sample.timestamp_ns = message.header.stamp_ns;
    cause = Convert(message, &sample);
    logs_->imu.push_back(sample);
    return cause;
  }

  std::string AddOdometry(const BagMessage& bytes) {
    RosOdometry message;
    std::string fixed_frame;
    std::string cause = ParseStamped(bytes, &message, &fixed_frame);
    if (!cause.empty()) return cause;
    if (logs_->wheel_frame.empty()) {
      logs_->wheel_frame = WithoutSlash(message.child_frame_id);
    }
    if (wheel_type_ != WheelType::kOdometry) {
      WheelSample sample;
      sample.timestamp_ns = message.header.stamp_ns;
      cause = Convert(message.linear, message.angular, &sample);
      logs_->wheel.push_back(sample);
      return cause;
    }
    OdometryPose pose;
    pose.timestamp_ns = message.header.stamp_ns;
    cause = Convert(message, &pose);
    logs_->odometry.push_back(pose);
    return cause;
  }

  std::string AddWheel(const BagMessage& bytes) {
    if (bytes.topic->type == "nav_msgs/Odometry") return AddOdometry(bytes);
    WheelSample sample;
    std::string cause;
    if (bytes.topic->type == "sensor_msgs/JointState") {
      RosJointState message;
      cause = ParseStamped(bytes, &message, &logs_->wheel_frame);
      sample.timestamp_ns = message.header.stamp_ns;
      if (cause.empty()) cause = Convert(message, &sample);
    } else {
      RosTwist message;
      cause = ParseStamped(bytes, &message, &logs_->wheel_frame);
      sample.timestamp_ns = message.header.stamp_ns;
      if (cause.empty()) {
        cause = Convert(message.linear, message.angular, &sample);
      }
    }
    if (cause.empty()) logs_->wheel.push_back(sample);
    return cause;
  }

  std::string AddImage(const BagMessage& bytes) {
    RosHeader header;
    if (!ParseRosHeader(bytes.topic->encoding, bytes.bytes, &header)) {
      return "its bytes are not a " + bytes.topic->type + " that ROS knows";
    }
    const std::string cause = CheckHeader(header, &logs_->image_frame);
    logs_->image_times_ns.push_back(header.stamp_ns);
    return cause;
  }

  std::string AddCameraInfo(const BagMessage& bytes) {
    if (logs_->camera_info.has_value()) return "";
    RosCameraInfo message;
    const std::string cause = Parse(bytes, &message);
    if (cause.empty()) logs_->camera_info = std::move(message);
    return cause;
  }

  std::string AddGnss(const BagMessage& bytes) {
    RosNavSatFix message;
    std::string frame;
    const std::string cause = ParseStamped(bytes, &message, &frame);
    const bool has_position =
        message.status >= 0 && std::isfinite(message.latitude) &&
        std::isfinite(message.longitude) && std::isfinite(message.altitude);
    if (cause.empty() && has_position) logs_->gnss.push_back(message);
    return cause;
  }

  std::string AddTransforms(const BagMessage& bytes) {
    std::vector<RosTransform> transforms;
    const std::string cause = Parse(bytes, &transforms);
    if (!cause.empty()) return cause;
    for (RosTransform& transform : transforms) {
      const bool is_rigid =
          std::abs(transform.rotation.norm() - 1.0) < kMaxNormError &&
          transform.translation.allFinite();
      if (!is_rigid) {
        return "the transform of " + transform.child + " is not rigid";
      }
      transform.parent = WithoutSlash(transform.parent);
      transform.child = WithoutSlash(transform.child);
      logs_->static_transforms.push_back(std::move(transform));
    }
    return "";
  }

  const BagTopics& topics_;
  WheelType wheel_type_;
  BagLogs* logs_;
};

template <typename Samples>
void SortByTime(Samples* samples) {
  std::stable_sort(samples->begin(), samples->end(),
                   [](const auto& a, const auto& b) {
                     return a.timestamp_ns < b.timestamp_ns;
                   });
}

WheelType TypeOfMessages(const std::optional<BagTopic>& topic) {
  if (!topic.has_value() || topic->type == "nav_msgs/Odometry") {
    return WheelType::kOdometry;
  }
  return topic->type == "sensor_msgs/JointState" ? WheelType::kTicks
                                                 : WheelType::kVelocity;
}

}  // namespace

StatusOr<BagLogs> ReadBagLogs(const std::string& path, BagReader* bag,
                              const BagTopics& topics,
                              const std::optional<WheelType>& wheel_type,
                              std::vector<std::string>* warnings) {
  BagLogs logs;
  logs.wheel_type = wheel_type.value_or(TypeOfMessages(topics.wheel));
  std::set<std::string> names = {kStaticTransforms};
  for (const auto& topic : {topics.imu, topics.wheel, topics.image,
                            topics.camera_info, topics.gnss}) {
    if (topic.has_value()) names.insert(topic->name);
  }
  LogCollector collector(topics, logs.wheel_type, &logs);
  std::map<std::string, size_t> counts;
  const Status status = bag->Read(
      names,
      [&](const BagMessage& message) {
        const size_t number = ++counts[message.topic->name];
        const std::string cause = collector.Add(message);
        if (cause.empty()) return Status::Ok();
        return Status::Error(path + ", message " + std::to_string(number) +
                             " of " + message.topic->name + ": " + cause);
      },
      warnings);
  if (!status.ok()) return status;
  SortByTime(&logs.imu);
  SortByTime(&logs.wheel);
  SortByTime(&logs.odometry);
  std::stable_sort(logs.gnss.begin(), logs.gnss.end(),
                   [](const RosNavSatFix& a, const RosNavSatFix& b) {
                     return a.header.stamp_ns < b.header.stamp_ns;
                   });
  std::vector<timestamp_t>& times = logs.image_times_ns;
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return logs;
}

std::optional<Rigid3d> FindTransform(
    const std::vector<RosTransform>& transforms, const std::string& target,
    const std::string& source) {
  if (target.empty() || source.empty()) return std::nullopt;
  // All frames connected with the source; the transforms sent last are used.
  std::map<std::string, Rigid3d> frame_from_source = {{source, Rigid3d()}};
  for (bool has_grown = true; has_grown;) {
    has_grown = false;
    for (size_t i = transforms.size(); i-- > 0;) {
      const RosTransform& edge = transforms[i];
      const Rigid3d parent_from_child(edge.rotation.normalized(),
                                      edge.translation);
      const auto parent = frame_from_source.find(edge.parent);
      const auto child = frame_from_source.find(edge.child);
      const bool has_parent = parent != frame_from_source.end();
      const bool has_child = child != frame_from_source.end();
      if (has_parent == has_child) continue;
      has_grown = true;
      if (has_child) {
        frame_from_source[edge.parent] = parent_from_child * child->second;
      } else {
        frame_from_source[edge.child] =
            parent_from_child.Inverse() * parent->second;
      }
    }
  }
  const auto found = frame_from_source.find(target);
  if (found == frame_from_source.end()) return std::nullopt;
  return found->second;
}

}  // namespace adasfm
