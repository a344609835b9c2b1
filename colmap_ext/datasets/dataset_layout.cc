// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/dataset_layout.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <stdexcept>
#include <vector>

#include "colmap_ext/datasets/calibrated_camera.h"
#include "colmap_ext/datasets/dataset_files.h"
#include "core/rigid3d.h"

namespace adasfm {
namespace {

YAML::Node ReadYaml(const std::string& path) {
  std::string text = ReadText(path);
  // OpenCV's header line is not valid YAML.
  if (text.rfind("%YAML:", 0) == 0) text.erase(0, text.find('\n'));
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

template <typename T>
T ReadValue(const YAML::Node& node, const std::string& key,
            const std::string& path) {
  try {
    return node[key].as<T>();
  } catch (const YAML::Exception&) {
    throw std::runtime_error(path + ": '" + key + "' is missing or malformed");
  }
}

// 16 numbers, row by row.
Rigid3d RigidFromNumbers(const std::vector<double>& numbers,
                         const std::string& path) {
  if (numbers.size() != 16) {
    throw std::runtime_error(path + ": a transform has " +
                             std::to_string(numbers.size()) +
                             " numbers; 16 are expected");
  }
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(
      numbers.data());
  return Rigid3d(RequireRotation(matrix.topLeftCorner<3, 3>(), path),
                 Eigen::Vector3d(matrix.topRightCorner<3, 1>()));
}

void SetCamera(const StatusOr<CalibratedCamera>& camera,
               const std::string& path, DatasetLayout* layout) {
  if (!camera.ok()) {
    throw std::runtime_error(
        path + ": the camera cannot be used: " + camera.status().message() +
        "; give --camera_model and --camera_params without --data_format");
  }
  layout->camera_model = camera->model;
  layout->camera_params = camera->params;
}

// DSO's format: "Pinhole fx fy cx cy 0" or "EquiDistant fx fy cx cy k1..k4",
// then sizes.
void ReadDsoCamera(const std::string& path, DatasetLayout* layout) {
  const std::string text = ReadText(path);
  const std::string line = text.substr(0, text.find('\n'));
  const size_t space = line.find(' ');
  const std::string model = line.substr(0, space);
  std::vector<double> numbers;
  if (space != std::string::npos) {
    numbers = NumbersFromText(line.substr(space), path);
  }
  if (numbers.size() < 4 || (model != "Pinhole" && model != "EquiDistant")) {
    throw std::runtime_error(path +
                             ": the first line is not 'Pinhole fx fy cx cy' "
                             "nor 'EquiDistant fx fy cx cy k1 k2 k3 k4'");
  }
  const std::vector<double> intrinsics(numbers.begin(), numbers.begin() + 4);
  std::vector<double> distortion;
  if (model == "EquiDistant") {
    distortion.assign(numbers.begin() + 4, numbers.end());
  }
  SetCamera(CameraOfCalibration(model == "Pinhole" ? "none" : "equidistant",
                                intrinsics, distortion),
            path, layout);
}

}  // namespace

StatusOr<DatasetLayout> FindEurocLayout(const std::string& root) {
  const std::string mav = PathExists(root + "/mav0") ? root + "/mav0" : root;
  DatasetLayout layout;
  layout.image_path = mav + "/cam0/data";
  layout.image_times_path = mav + "/cam0/data.csv";
  RequireFile(layout.image_path);
  RequireFile(layout.image_times_path);
  const std::string camera_path = mav + "/cam0/sensor.yaml";
  const YAML::Node camera = ReadYaml(camera_path);
  SetCamera(
      CameraOfCalibration(
          ReadValue<std::string>(camera, "distortion_model", camera_path),
          ReadValue<std::vector<double>>(camera, "intrinsics", camera_path),
          ReadValue<std::vector<double>>(camera, "distortion_coefficients",
                                         camera_path)),
      camera_path, &layout);
  if (!PathExists(mav + "/imu0/data.csv")) return layout;
  layout.imu_path = mav + "/imu0/data.csv";
  const std::string imu_path = mav + "/imu0/sensor.yaml";
  const YAML::Node imu = ReadYaml(imu_path);
  const auto body_from_sensor = [](const YAML::Node& node,
                                   const std::string& path) {
    return RigidFromNumbers(
        ReadValue<std::vector<double>>(node["T_BS"], "data", path), path);
  };
  ImuDescription description;
  description.rate_hz = ReadValue<double>(imu, "rate_hz", imu_path);
  ImuNoise& noise = description.noise;
  const std::pair<const char*, double*> values[] = {
      {"gyroscope_noise_density", &noise.gyroscope_noise_density},
      {"gyroscope_random_walk", &noise.gyroscope_random_walk},
      {"accelerometer_noise_density", &noise.accelerometer_noise_density},
      {"accelerometer_random_walk", &noise.accelerometer_random_walk}};
  for (const auto& [key, value] : values) {
    *value = ReadValue<double>(imu, key, imu_path);
  }
  layout.sensors_text =
      FormatSensorsYaml(body_from_sensor(camera, camera_path).Inverse() *
                            body_from_sensor(imu, imu_path),
                        0.0, description);
  return layout;
}

StatusOr<DatasetLayout> Find4SeasonsLayout(const std::string& root) {
  DatasetLayout layout;
  const std::string calibration = PathExists(root + "/calibration")
                                      ? root + "/calibration"
                                      : root + "/../calibration";
  const bool is_undistorted = PathExists(root + "/undistorted_images/cam0");
  layout.image_path = root + (is_undistorted ? "/undistorted_images/cam0"
                                             : "/distorted_images/cam0");
  layout.image_times_path = root + "/times.txt";
  RequireFile(layout.image_path);
  RequireFile(layout.image_times_path);
  ReadDsoCamera(calibration + (is_undistorted ? "/undistorted_calib_0.txt"
                                              : "/calib_0.txt"),
                &layout);
  if (!PathExists(root + "/imu.txt")) return layout;
  layout.imu_path = root + "/imu.txt";
  const std::string chain_path = calibration + "/camchain.yaml";
  const YAML::Node camera = ReadYaml(chain_path)["cam0"];
  std::vector<double> numbers;
  for (const std::vector<double>& row :
       ReadValue<std::vector<std::vector<double>>>(camera, "T_cam_imu",
                                                   chain_path)) {
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  const double timeshift_s =
      camera["timeshift_cam_imu"]
          ? ReadValue<double>(camera, "timeshift_cam_imu", chain_path)
          : 0.0;
  ImuDescription description;
  description.rate_hz = 2000.0;  // the recordings' Analog Devices ADIS16465
  layout.sensors_text = FormatSensorsYaml(RigidFromNumbers(numbers, chain_path),
                                          timeshift_s, description);
  return layout;
}

StatusOr<DatasetLayout> FindTumLayout(const std::string& root) {
  DatasetLayout layout;
  layout.image_path = root + "/rgb";
  layout.image_times_path = root + "/rgb.txt";
  RequireFile(layout.image_path);
  RequireFile(layout.image_times_path);
  return layout;
}

StatusOr<DatasetLayout> FindDatasetLayout(const std::string& format,
                                          const std::string& root) {
  try {
    if (format == "euroc") return FindEurocLayout(root);
    if (format == "4seasons") return Find4SeasonsLayout(root);
    if (format == "tum") return FindTumLayout(root);
    if (format == "kitti") {
      return PathExists(root + "/oxts") ? FindKittiRawLayout(root)
                                        : FindKittiOdometryLayout(root);
    }
  } catch (const std::runtime_error& error) {
    return Status::Error(error.what());
  }
  return Status::Error("data_format = " + format +
                       " must be euroc, 4seasons, kitti or tum");
}

}  // namespace adasfm
