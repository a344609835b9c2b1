// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/end_to_end/drive_bag.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "sensors/io/calibration.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

void WriteExtrinsics(const SensorCalibration& calibration, timestamp_t time_ns,
                     BagWriter* bag) {
  const Rigid3d imu_from_cam = calibration.cam_from_imu.Inverse();
  bag->Write("/tf_static", "tf2_msgs/msg/TFMessage", time_ns,
             TransformMessage({time_ns, "imu_link"}, "camera_optical",
                              imu_from_cam.translation, imu_from_cam.rotation));
  // The other way round, as a robot's description has it.
  const Rigid3d wheel_from_imu = calibration.imu_from_wheel.Inverse();
  bag->Write(
      "/tf_static", "tf2_msgs/msg/TFMessage", time_ns,
      TransformMessage({time_ns, "base_link"}, "imu_link",
                       wheel_from_imu.translation, wheel_from_imu.rotation));
}

void WriteOdometry(const std::vector<WheelSample>& samples, double track_width,
                   BagWriter* bag) {
  double yaw = 0.0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < samples.size(); ++i) {
    const WheelSample& sample = samples[i];
    const double speed = 0.5 * (sample.first + sample.second);
    const double rate = (sample.second - sample.first) / track_width;
    if (i > 0) {
      const double step_s =
          SecondsFromNs(sample.timestamp_ns - samples[i - 1].timestamp_ns);
      const double heading = yaw + 0.5 * rate * step_s;
      position += speed * step_s *
                  Eigen::Vector3d(std::cos(heading), std::sin(heading), 0.0);
      yaw += rate * step_s;
    }
    const Eigen::Quaterniond rotation(
        Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
    bag->Write(
        "/odom", "nav_msgs/msg/Odometry", sample.timestamp_ns,
        OdometryMessage({sample.timestamp_ns, "odom"}, "base_link", position,
                        rotation, {speed, 0.0, 0.0}, {0.0, 0.0, rate}));
  }
}

void WritePhotos(const std::string& folder, const DriveBagOptions& options,
                 const std::vector<double>& intrinsics, BagWriter* bag) {
  const auto times = ReadImageTimes(folder + "/times.csv");
  for (const ImageTime& time : times.value()) {
    const MessageFrame frame{time.timestamp_ns, "camera_optical"};
    const std::string path = folder + "/images/" + time.name;
    const cv::Mat picture = cv::imread(path);
    bag->Write("/camera/camera_info", "sensor_msgs/msg/CameraInfo",
               time.timestamp_ns,
               CameraInfoMessage(frame, picture.rows, picture.cols, "plumb_bob",
                                 {0, 0, 0, 0, 0},
                                 {intrinsics[0], 0, intrinsics[2], 0,
                                  intrinsics[1], intrinsics[3], 0, 0, 1}));
    if (!options.has_raw_images) {
      bag->Write("/camera/image_raw/compressed",
                 "sensor_msgs/msg/CompressedImage", time.timestamp_ns,
                 CompressedImageMessage(frame, "png", ReadBytes(path)));
      continue;
    }
    bag->Write("/camera/image_raw", "sensor_msgs/msg/Image", time.timestamp_ns,
               ImageMessage(frame, picture.rows, picture.cols, "bgr8",
                            3 * picture.cols,
                            std::string(picture.datastart, picture.dataend)));
  }
}

}  // namespace

void WriteDriveBag(const std::string& folder, const std::string& bag_path,
                   const DriveBagOptions& options) {
  const SensorCalibration calibration =
      ReadSensorCalibration(folder + "/sensors.yaml").value();
  const auto intrinsics =
      YAML::LoadFile(folder + "/sensors.yaml")["cam0"]["intrinsics"]
          .as<std::vector<double>>();
  BagWriter bag(bag_path, options.writer);
  const std::vector<ImuSample> imu = ReadImu(folder + "/imu.csv").value();
  if (options.has_extrinsics) {
    WriteExtrinsics(calibration, imu[0].timestamp_ns, &bag);
  }
  for (const ImuSample& sample : imu) {
    for (const char* topic : {"/imu", "/imu/raw"}) {
      if (topic == std::string("/imu/raw") && !options.has_second_imu) continue;
      bag.Write(topic, "sensor_msgs/msg/Imu", sample.timestamp_ns,
                ImuMessage({sample.timestamp_ns, "imu_link"},
                           sample.angular_velocity, sample.specific_force));
    }
  }
  WriteOdometry(
      ReadWheel(folder + "/wheel.csv", WheelType::kDifferential).value(),
      calibration.track_width_m, &bag);
  WritePhotos(folder, options, intrinsics, &bag);
}

}  // namespace adasfm
