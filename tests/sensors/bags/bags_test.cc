// SPDX-License-Identifier: BSD-3-Clause
// Bags written by a writer of the tests' own (tests/testing/bag_writer.h), read
// by sensors/bags and sensors/io/read_bag.h.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include <filesystem>

#include "sensors/io/bag_logs.h"
#include "sensors/io/read_bag.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"
#include "tests/testing/bag_writer.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;
constexpr timestamp_t kPeriodNs = 5'000'000;
constexpr int kNumMessages = 2000;
constexpr char kImuType[] = "sensor_msgs/msg/Imu";

std::string Imu(int i, bool is_big_endian = false) {
  return ImuMessage({kStartNs + i * kPeriodNs, "imu", is_big_endian},
                    {0.1, 0.2 + 1e-3 * i, 0.3}, {0.5, -0.25, 9.81});
}

class Bags : public testing::Test {
 protected:
  // An IMU whose messages arrive in pairs the wrong way round, and chatter.
  std::string WriteImuBag(const std::string& name,
                          const BagWriterOptions& options,
                          bool is_big_endian = false) {
    BagWriter bag(folder_.File(name), options);
    for (int i = 0; i < kNumMessages; ++i) {
      bag.Write("/imu/data", kImuType, kStartNs, Imu(i ^ 1, is_big_endian));
      bag.Write("/chatter", "std_msgs/msg/String", kStartNs,
                CdrWriter().AddText("hello").bytes());
    }
    return folder_.File(name);
  }

  std::string ErrorOf(const Status& status) {
    EXPECT_FALSE(status.ok());
    EXPECT_EQ(status.message().find('\n'), std::string::npos);
    return status.message();
  }
  std::string ImuError(const std::string& path) {
    return ErrorOf(ReadImu(path).status());
  }

  void ExpectImu(const std::string& path, int num_messages = kNumMessages) {
    std::vector<std::string> warnings;
    const StatusOr<std::vector<ImuSample>> imu = ReadImu(path, &warnings);
    ASSERT_TRUE(imu.ok()) << imu.status().message();
    EXPECT_THAT(warnings, IsEmpty());
    ASSERT_EQ(imu->size(), num_messages);
    for (int i = 0; i < num_messages; ++i) {
      const ImuSample& sample = (*imu)[i];
      ASSERT_EQ(sample.timestamp_ns, kStartNs + i * kPeriodNs);
      ASSERT_EQ(sample.angular_velocity,
                Eigen::Vector3d(0.1, 0.2 + 1e-3 * i, 0.3));
      ASSERT_EQ(sample.specific_force, Eigen::Vector3d(0.5, -0.25, 9.81));
    }
  }

  void Overwrite(const std::string& path, size_t position,
                 const std::string& bytes) {
    std::string file = ReadBytes(path);
    ASSERT_LE(position + bytes.size(), file.size());
    file.replace(position, bytes.size(), bytes);
    std::ofstream(path, std::ios::binary) << file;
  }

  TemporaryFolder folder_;
};

TEST_F(Bags, EveryContainerAndByteOrderGivesBackWhatWasWritten) {
  for (const char* compression : {"none", "", "lz4", "zstd"}) {
    for (const bool has_summary : {true, false}) {
      for (const bool is_big_endian : {true, false}) {
        SCOPED_TRACE(std::string(compression) + std::to_string(has_summary) +
                     std::to_string(is_big_endian));
        const std::string path = WriteImuBag(
            "drive.mcap", {compression, has_summary}, is_big_endian);
        ExpectImu(path);
        ExpectImu(path + ":/imu/data");
      }
    }
  }
  ExpectImu(WriteImuBag("drive.db3", {}));
}

TEST_F(Bags, PathsAreToldByTheirName) {
  EXPECT_TRUE(IsBagPath("drive.bag"));
  EXPECT_TRUE(IsBagPath("a/drive.mcap:/imu/data"));
  EXPECT_TRUE(IsBagPath("drive.db3"));
  EXPECT_FALSE(IsBagPath("imu.csv"));
  EXPECT_FALSE(IsBagPath(".bag"));
  EXPECT_FALSE(IsBagPath(folder_.Path()));
  WriteImuBag("drive.mcap", {});
  EXPECT_TRUE(IsBagPath(folder_.Path()));
}

TEST_F(Bags, AFolderIsReadInTheOrderOfItsMetadata) {
  {
    BagWriter first(folder_.File("x_1.mcap"), {});
    BagWriter second(folder_.File("x_0.mcap"), {});
    for (int i = 0; i < kNumMessages; ++i) {
      (i < 1000 ? first : second).Write("/imu", kImuType, 0, Imu(i));
    }
  }
  ExpectImu(folder_.Path());
  folder_.Write("metadata.yaml",
                "rosbag2_bagfile_information:\n"
                "  relative_file_paths: [x_1.mcap]\n");
  ExpectImu(folder_.Path(), 1000);
  folder_.Write("metadata.yaml",
                "rosbag2_bagfile_information:\n"
                "  relative_file_paths: [x_1.mcap.zstd]\n");
  EXPECT_THAT(ImuError(folder_.Path()), HasSubstr("zstd -d"));
  folder_.Write("metadata.yaml", "a: [");
  EXPECT_THAT(ImuError(folder_.Path()), HasSubstr("metadata.yaml"));
}

TEST_F(Bags, MessagesOfDb3MayBeCompressed) {
  const std::string path = folder_.File("drive.db3");
  {
    BagWriter bag(path, {});
    for (int i = 0; i < kNumMessages; ++i) {
      const std::string message = Imu(i);
      std::string packed(ZSTD_compressBound(message.size()), '\0');
      packed.resize(ZSTD_compress(packed.data(), packed.size(), message.data(),
                                  message.size(), 1));
      bag.Write("/imu", kImuType, 0, packed);
    }
  }
  ExpectImu(path);
}

TEST_F(Bags, ACutFileIsReadAsFarAsItGoes) {
  for (const char* compression : {"none", "", "lz4", "zstd"}) {
    SCOPED_TRACE(compression);
    const std::string path = WriteImuBag("drive.mcap", {compression});
    fs::resize_file(path, fs::file_size(path) / 2);
    std::vector<std::string> warnings;
    const StatusOr<std::vector<ImuSample>> imu = ReadImu(path, &warnings);
    ASSERT_TRUE(imu.ok()) << imu.status().message();
    EXPECT_GT(imu->size(), 0.4 * kNumMessages);
    EXPECT_LT(imu->size(), 0.6 * kNumMessages);
    ASSERT_FALSE(warnings.empty());
    EXPECT_THAT(warnings[0], HasSubstr("cut short"));
  }
}

TEST_F(Bags, ACutDatabaseIsAnErrorOrIsReadAsFarAsItGoes) {
  const std::string path = WriteImuBag("drive.db3", {});
  fs::resize_file(path, fs::file_size(path) / 2 / 4096 * 4096);
  std::vector<std::string> warnings;
  const StatusOr<std::vector<ImuSample>> imu = ReadImu(path, &warnings);
  if (imu.ok()) {
    EXPECT_LT(imu->size(), kNumMessages);
    EXPECT_FALSE(warnings.empty());
  } else {
    EXPECT_THAT(imu.status().message(), HasSubstr("drive.db3"));
  }
}

TEST_F(Bags, ADamagedChunkIsLeftOut) {
  for (const char* compression : {"", "lz4", "zstd"}) {
    SCOPED_TRACE(compression);
    const std::string path = WriteImuBag("drive.mcap", {compression});
    Overwrite(path, fs::file_size(path) / 2, "!damage!");
    std::vector<std::string> warnings;
    const StatusOr<std::vector<ImuSample>> imu = ReadImu(path, &warnings);
    ASSERT_TRUE(imu.ok()) << imu.status().message();
    EXPECT_GT(imu->size(), 0.7 * kNumMessages);
    EXPECT_LT(imu->size(), kNumMessages);
    ASSERT_FALSE(warnings.empty());
    EXPECT_THAT(warnings[0], HasSubstr("1 damaged chunks are left out"));
  }
}

TEST_F(Bags, HugeClaimsAreDamageAndTakeNoMemory) {
  const std::string huge(8, '\xff');
  // Offset of the first record behind the header: opcode, then its length.
  const std::string path = WriteImuBag("drive.mcap", {"zstd"});
  const size_t chunk = 8 + 9 + 4 + 4 + 4 + 4;
  Overwrite(path, chunk + 9 + 16, huge);  // the chunk's uncompressed size
  std::vector<std::string> warnings;
  ASSERT_TRUE(ReadImu(path, &warnings).ok());
  EXPECT_THAT(warnings[0], HasSubstr("claims"));
  Overwrite(path, chunk + 1, huge);  // the record's length
  EXPECT_THAT(ImuError(path), HasSubstr("cut short or damaged"));
}

TEST_F(Bags, OtherFilesAreErrors) {
  EXPECT_THAT(ImuError(folder_.File("none.mcap")), HasSubstr("no such file"));
  EXPECT_THAT(ImuError(folder_.Write("a.mcap", "0,0,0,0,0,0,9.81\n")),
              HasSubstr("not an MCAP file"));
  EXPECT_THAT(ImuError(folder_.Write("a.mcap", "")),
              HasSubstr("not an MCAP file"));
  EXPECT_THAT(ImuError(folder_.Write("a.db3", "no database")),
              HasSubstr("rosbag2"));
  EXPECT_THAT(ImuError(folder_.Write("a.db3", "")), HasSubstr("rosbag2"));
}

TEST_F(Bags, TopicsMustBeClear) {
  const std::string path = folder_.File("drive.mcap");
  {
    BagWriter bag(path, {});
    for (int i = 0; i < kNumMessages; ++i) {
      bag.Write("/imu/data", kImuType, 0, Imu(i));
      bag.Write("/imu/raw", kImuType, 0, Imu(i));
    }
  }
  const std::string several = ImuError(path);
  EXPECT_THAT(several, HasSubstr("/imu/data (sensor_msgs/Imu), /imu/raw"));
  EXPECT_THAT(several, HasSubstr("--imu_topic /imu/data"));
  ExpectImu(path + ":/imu/raw");
  EXPECT_THAT(ImuError(path + ":/gyro"), HasSubstr("/imu/raw"));
  EXPECT_THAT(ErrorOf(ReadOdometry(path).status()),
              HasSubstr("no topic of type nav_msgs/Odometry"));
}

TEST_F(Bags, MistakesAreNamedWithTheirMessage) {
  const auto error = [&](const std::string& sixth) {
    const std::string path = folder_.File("drive.mcap");
    {
      BagWriter bag(path, {});
      for (int i = 0; i < kNumMessages; ++i) {
        bag.Write("/imu", kImuType, 0, i == 5 ? sixth : Imu(i));
      }
    }
    return ImuError(path);
  };
  EXPECT_THAT(error(Imu(5).substr(0, 100)),
              HasSubstr("message 6 of /imu: its bytes are not"));
  EXPECT_THAT(error(Imu(5) + std::string(20, '\0')), HasSubstr("are not"));
  EXPECT_THAT(error(""), HasSubstr("are not"));
  EXPECT_THAT(error(ImuMessage({0, "imu"}, {0, 0, 0}, {0, 0, 9.81})),
              HasSubstr("message 6 of /imu: its header has no stamp"));
  EXPECT_THAT(error(ImuMessage({kStartNs + 5 * kPeriodNs, "imu"},
                               {0, 0, std::nan("")}, {0, 0, 9.81})),
              HasSubstr("not finite"));
  EXPECT_THAT(error(Imu(4)), HasSubstr("message 6"));
}

TEST_F(Bags, WheelsOfEveryMessageType) {
  const std::string path = folder_.File("drive.mcap");
  {
    BagWriter bag(path, {});
    for (int i = 0; i < 100; ++i) {
      const MessageFrame frame{kStartNs + i * kPeriodNs, "base_link"};
      const Eigen::Vector3d linear(0.5, 0.0, 0.0), angular(0.0, 0.0, 0.01 * i);
      bag.Write("/odom", "nav_msgs/msg/Odometry", 0,
                OdometryMessage(frame, "base", {0.05 * i, 2.0, 0.0},
                                {0.8, 0.0, 0.0, 0.6}, linear, angular));
      bag.Write("/twist", "geometry_msgs/msg/TwistStamped", 0,
                TwistMessage(frame, 2 * linear, angular, false));
      bag.Write("/cov", "geometry_msgs/msg/TwistWithCovarianceStamped", 0,
                TwistMessage(frame, 3 * linear, angular, true));
      bag.Write("/joints", "sensor_msgs/msg/JointState", 0,
                JointStateMessage(frame, {"arm", "wheel_left", "wheel_right"},
                                  {0.0, 0.1 * i, 0.2 * i}));
    }
  }
  const StatusOr<std::vector<OdometryPose>> poses = ReadOdometry(path);
  ASSERT_TRUE(poses.ok()) << poses.status().message();
  EXPECT_EQ((*poses)[30].world_from_body.translation,
            Eigen::Vector3d(1.5, 2.0, 0.0));
  EXPECT_NEAR((*poses)[30].world_from_body.rotation.z(), 0.6, 1e-12);
  const std::pair<const char*, double> speeds[] = {
      {":/odom", 0.5}, {":/twist", 1.0}, {":/cov", 1.5}};
  for (const auto& [topic, speed] : speeds) {
    const auto wheel = ReadWheel(path + topic, WheelType::kVelocity);
    ASSERT_TRUE(wheel.ok()) << wheel.status().message();
    EXPECT_EQ((*wheel)[7].first, speed);
    EXPECT_EQ((*wheel)[7].second, 0.07);
  }
  const auto ticks = ReadWheel(path, WheelType::kTicks);
  ASSERT_TRUE(ticks.ok()) << ticks.status().message();
  EXPECT_EQ((*ticks)[10].second, 2.0);
  EXPECT_THAT(ErrorOf(ReadWheel(path, WheelType::kVelocity).status()),
              HasSubstr("--wheel_topic"));
  EXPECT_THAT(ErrorOf(ReadWheel(path, WheelType::kDifferential).status()),
              HasSubstr("wheel0/type"));
}

TEST_F(Bags, JointsThatAreNoPairOfWheelsAreListed) {
  const std::string path = folder_.File("drive.mcap");
  {
    BagWriter bag(path, {});
    bag.Write("/joints", "sensor_msgs/msg/JointState", 0,
              JointStateMessage({kStartNs, ""}, {"front_left", "rear_left"},
                                {0.0, 0.0}));
  }
  EXPECT_THAT(ErrorOf(ReadWheel(path, WheelType::kTicks).status()),
              HasSubstr("front_left, rear_left"));
}

TEST_F(Bags, ADriveIsReadInOnePass) {
  const std::string path = folder_.File("drive.mcap");
  const Eigen::Quaterniond quarter(
      Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d::UnitZ()));
  {
    BagWriter bag(path, {"lz4"});
    bag.Write(
        "/tf_static", "tf2_msgs/msg/TFMessage", 0,
        TransformMessage({kStartNs, "base"}, "camera", {1, 2, 3}, quarter));
    bag.Write("/tf_static", "tf2_msgs/msg/TFMessage", 0,
              TransformMessage({kStartNs, "base"}, "/imu", {0, 0, 1},
                               Eigen::Quaterniond::Identity()));
    bag.Write("/imu", kImuType, 0, Imu(0));
    bag.Write("/cam/camera_info", "sensor_msgs/msg/CameraInfo", 0,
              CameraInfoMessage({kStartNs, "camera"}, 3, 4, "plumb_bob",
                                {0.1, 0.2, 0.3, 0.4, 0.5},
                                {5, 0, 2, 0, 6, 1, 0, 0, 1}));
    bag.Write("/other/camera_info", "sensor_msgs/msg/CameraInfo", 0, "");
    bag.Write("/fix", "sensor_msgs/msg/NavSatFix", 0,
              NavSatFixMessage({kStartNs, "gnss"}, 48.1, 11.5, 500.0, 0.25));
    for (const int i : {2, 1, 1}) {
      bag.Write("/cam/image_raw/compressed", "sensor_msgs/msg/CompressedImage",
                0,
                CompressedImageMessage({kStartNs + i, "camera"}, "jpeg",
                                       "\xff\xd8\xff"));
    }
  }
  const auto bag = OpenBag(path);
  ASSERT_TRUE(bag.ok()) << bag.status().message();
  const auto topics = FindDriveTopics(path, (*bag)->Topics(), {}, std::nullopt);
  ASSERT_TRUE(topics.ok()) << topics.status().message();
  EXPECT_EQ(topics->camera_info->name, "/cam/camera_info");
  EXPECT_FALSE(topics->wheel.has_value());
  std::vector<std::string> warnings;
  const auto logs =
      ReadBagLogs(path, bag->get(), *topics, std::nullopt, &warnings);
  ASSERT_TRUE(logs.ok()) << logs.status().message();
  EXPECT_THAT(warnings, IsEmpty());
  EXPECT_EQ(logs->image_times_ns,
            (std::vector<timestamp_t>{kStartNs + 1, kStartNs + 2}));
  EXPECT_EQ(logs->camera_info->k[4], 6.0);
  EXPECT_EQ(logs->camera_info->p[6], 1.0);
  EXPECT_EQ(logs->camera_info->distortion[4], 0.5);
  EXPECT_EQ(logs->image_frame, "camera");
  ASSERT_EQ(logs->gnss.size(), 1);
  EXPECT_EQ(logs->gnss[0].longitude, 11.5);
  EXPECT_EQ(logs->gnss[0].position_covariance[8], 1.0);
  const auto camera_from_imu =
      FindTransform(logs->static_transforms, "camera", "imu");
  ASSERT_TRUE(camera_from_imu.has_value());
  // The IMU's origin is (-1, -2, -2) from the camera in the base's axes.
  EXPECT_LT((camera_from_imu->translation - Eigen::Vector3d(-2, 1, -2)).norm(),
            1e-12);
  EXPECT_FALSE(
      FindTransform(logs->static_transforms, "camera", "moon").has_value());
}

}  // namespace
}  // namespace adasfm
