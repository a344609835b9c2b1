// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bags/ros1_bag.h"

#include <map>
#include <utility>

#ifdef ADASFM_HAS_ROSBAG
#include <rosbag/bag.h>
#include <rosbag/view.h>
#endif

namespace adasfm {

#ifdef ADASFM_HAS_ROSBAG

namespace {

std::string DescribeFailure(const std::string& path,
                            const std::exception& exception) {
  return path + ": cannot be read as a ROS 1 bag (" + exception.what() +
         "); was it closed? try rosbag reindex";
}

class Ros1Bag : public BagReader {
 public:
  // Throws what the library throws.
  explicit Ros1Bag(const std::string& path) : path_(path) {
    bag_.open(path, rosbag::bagmode::Read);
    rosbag::View view(bag_);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
      topics_.push_back(
          {connection->topic, connection->datatype, RosEncoding::kRos1});
    }
    SortTopics(&topics_);
  }

  const std::vector<BagTopic>& Topics() const override { return topics_; }

  Status Read(const std::set<std::string>& topics, const BagVisitor& visit,
              std::vector<std::string>*) override {
    std::map<std::string, const BagTopic*> by_name;
    for (const BagTopic& topic : topics_) by_name[topic.name] = &topic;
    try {
      rosbag::View view(bag_, rosbag::TopicQuery(std::vector<std::string>(
                                  topics.begin(), topics.end())));
      std::vector<uint8_t> bytes;
      for (const rosbag::MessageInstance& message : view) {
        bytes.resize(message.size());
        ros::serialization::OStream stream(bytes.data(), bytes.size());
        message.write(stream);
        const Status status = visit(
            {by_name.at(message.getTopic()), {bytes.data(), bytes.size()}});
        if (!status.ok()) return status;
      }
    } catch (const ros::Exception& exception) {
      return Status::Error(DescribeFailure(path_, exception));
    }
    return Status::Ok();
  }

 private:
  std::string path_;
  rosbag::Bag bag_;
  std::vector<BagTopic> topics_;
};

}  // namespace

bool CanReadRos1Bags() { return true; }

StatusOr<std::unique_ptr<BagReader>> OpenRos1Bag(const std::string& path) {
  try {
    return std::unique_ptr<BagReader>(std::make_unique<Ros1Bag>(path));
  } catch (const std::exception& exception) {
    return Status::Error(DescribeFailure(path, exception));
  }
}

#else

bool CanReadRos1Bags() { return false; }

StatusOr<std::unique_ptr<BagReader>> OpenRos1Bag(const std::string& path) {
  return Status::Error(path +
                       ": this build cannot read ROS 1 bags; install "
                       "librosbag-storage-dev, libsensor-msgs-dev and "
                       "libnav-msgs-dev and build again");
}

#endif

}  // namespace adasfm
