// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/calibration.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "sensors/io/log_file.h"

namespace adasfm {
namespace {

// Calibrations are printed with a few digits only.
constexpr double kRotationTolerance = 1e-2;

// yaml-cpp quotes what it could not read, and scalars may span lines.
std::string OneLine(std::string text) {
  for (char& c : text) {
    if (std::iscntrl(static_cast<unsigned char>(c))) c = ' ';
  }
  return text;
}

// Reads keys of one YAML file. Errors are thrown as one line;
// ReadSensorCalibration converts them to a Status.
class CalibrationReader {
 public:
  explicit CalibrationReader(const std::string& path) : path_(path) {}

  [[noreturn]] void Fail(const std::string& key, const std::string& why) const {
    throw std::runtime_error(path_ + ": " + key + " " + why);
  }

  // A finite number. Not parsed by yaml-cpp, which follows the global locale.
  double Number(const YAML::Node& section, const std::string& name) const {
    const YAML::Node node = section[name];
    if (!node) Fail(name, "is missing; add it (docs/reference/sensors.md)");
    double value = 0.0;
    if (!node.IsScalar() || !ParseDouble(node.Scalar(), &value)) {
      Fail(name, "is not a number");
    }
    return value;
  }

  double NumberOr(const YAML::Node& section, const std::string& name,
                  double fallback) const {
    return section[name] ? Number(section, name) : fallback;
  }

  // A number in the range of sensible values. A number that stands for "none"
  // or has a wrong unit would make the estimate overflow or useless.
  double InRange(const YAML::Node& section, const std::string& name, double min,
                 double max, const char* unit) const {
    const double value = Number(section, name);
    if (value >= min && value <= max) return value;
    if (value <= 0.0) Fail(name, "must be positive");
    std::ostringstream text;
    text << "is " << value << " " << unit << "; between " << min << " and "
         << max << " is possible";
    Fail(name, text.str());
  }

  Eigen::Vector3d Vector(const YAML::Node& section,
                         const std::string& name) const {
    const YAML::Node node = section[name];
    if (!node) {
      Fail(name, "is missing; add three numbers (docs/reference/sensors.md)");
    }
    if (!node.IsSequence() || node.size() != 3) Fail(name, "is not 3 numbers");
    Eigen::Vector3d vector;
    for (int i = 0; i < 3; ++i) {
      if (!node[i].IsScalar() || !ParseDouble(node[i].Scalar(), &vector(i))) {
        Fail(name, "holds something that is not a number");
      }
    }
    return vector;
  }

  Rigid3d Transform(const YAML::Node& section, const std::string& name) const {
    const YAML::Node node = section[name];
    if (!node)
      Fail(name, "is missing; add the 4x4 matrix (docs/reference/sensors.md)");
    Eigen::Matrix4d matrix;
    if (!node.IsSequence() || node.size() != 4) Fail(name, "is not 4x4");
    for (int row = 0; row < 4; ++row) {
      if (!node[row].IsSequence() || node[row].size() != 4) {
        Fail(name, "is not 4x4: row " + std::to_string(row + 1) +
                       " does not have 4 numbers");
      }
      for (int column = 0; column < 4; ++column) {
        const YAML::Node entry = node[row][column];
        if (!entry.IsScalar() ||
            !ParseDouble(entry.Scalar(), &matrix(row, column))) {
          Fail(name, "holds something that is not a number");
        }
      }
    }
    return CheckTransform(name, matrix);
  }

 private:
  Rigid3d CheckTransform(const std::string& name,
                         const Eigen::Matrix4d& matrix) const {
    const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
    const double error =
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
    if (error > kRotationTolerance) {
      Fail(name,
           "is not a rotation in its upper left 3x3 (rows are not unit and "
           "orthogonal); copy all digits, row by row");
    }
    if (rotation.determinant() < 0.0) {
      Fail(name,
           "mirrors (determinant -1): two axes are swapped or one sign "
           "is wrong");
    }
    const Eigen::RowVector4d last_row(0.0, 0.0, 0.0, 1.0);
    if ((matrix.row(3) - last_row).norm() > 1e-6) {
      Fail(name, "does not end in the row [0, 0, 0, 1]");
    }
    return Rigid3d(rotation, matrix.topRightCorner<3, 1>());
  }

  std::string path_;
};

// Cameras that are triggered together have one clock.
constexpr double kMaxTimeshiftDifference = 1e-3;

void ReadOtherCameras(const CalibrationReader& reader, const YAML::Node& root,
                      SensorCalibration* calibration) {
  for (int k = 1;; ++k) {
    const std::string name = "cam" + std::to_string(k);
    const YAML::Node camera = root[name];
    if (!camera || !camera.IsMap()) return;
    // A camera without extrinsics is not part of the rig.
    if (!camera["T_cam_imu"]) return;
    calibration->other_cams_from_imu.push_back(
        reader.Transform(camera, "T_cam_imu"));
    const double shift = reader.NumberOr(camera, "timeshift_cam_imu",
                                         calibration->timeshift_cam_imu_s);
    if (std::abs(shift - calibration->timeshift_cam_imu_s) >
        kMaxTimeshiftDifference) {
      reader.Fail(name + "/timeshift_cam_imu",
                  "differs from cam0's by more than a millisecond; cameras of "
                  "a rig take their images at the same times");
    }
  }
}

void ReadImuSection(const CalibrationReader& reader, const YAML::Node& imu,
                    SensorCalibration* calibration) {
  calibration->has_imu = true;
  calibration->imu_rate_hz =
      reader.InRange(imu, "update_rate", 1.0, 20000.0, "Hz");
  // From a tenth of what the best fibre-optic and quartz sensors have to a
  // hundred times what the poorest MEMS have.
  ImuNoise& noise = calibration->imu_noise;
  noise.gyroscope_noise_density = reader.InRange(imu, "gyroscope_noise_density",
                                                 1e-8, 1.0, "rad/s/sqrt(Hz)");
  noise.gyroscope_random_walk = reader.InRange(imu, "gyroscope_random_walk",
                                               1e-12, 0.1, "rad/s^2/sqrt(Hz)");
  noise.accelerometer_noise_density = reader.InRange(
      imu, "accelerometer_noise_density", 1e-7, 10.0, "m/s^2/sqrt(Hz)");
  noise.accelerometer_random_walk = reader.InRange(
      imu, "accelerometer_random_walk", 1e-11, 1.0, "m/s^3/sqrt(Hz)");
}

void ReadWheelSection(const CalibrationReader& reader, const YAML::Node& wheel,
                      SensorCalibration* calibration) {
  static const std::map<std::string, WheelType> kTypes = {
      {"differential", WheelType::kDifferential},
      {"velocity", WheelType::kVelocity},
      {"speed", WheelType::kSpeed},
      {"ticks", WheelType::kTicks},
      {"encoder", WheelType::kEncoder},
      {"steering", WheelType::kSteering},
      {"odometry", WheelType::kOdometry}};
  calibration->has_wheel = true;
  if (!wheel["type"] || !wheel["type"].IsScalar()) {
    reader.Fail("wheel0/type", "is missing; add the kind of wheel log");
  }
  const auto type = kTypes.find(wheel["type"].Scalar());
  if (type == kTypes.end()) {
    reader.Fail(
        "wheel0/type",
        "is '" + wheel["type"].Scalar() +
            "'; differential, velocity, speed, steering, ticks, encoder "
            "or odometry are known");
  }
  calibration->wheel_type = type->second;
  if (type->second == WheelType::kDifferential ||
      type->second == WheelType::kTicks) {
    calibration->track_width_m =
        reader.InRange(wheel, "track_width", 0.01, 20.0, "m");
  }
  if (CountsTicks(type->second)) {
    calibration->metres_per_tick =
        reader.InRange(wheel, "metres_per_tick", 1e-9, 10.0, "m");
  }
  if (type->second == WheelType::kSteering) {
    calibration->wheelbase_m =
        reader.InRange(wheel, "wheelbase", 0.05, 20.0, "m");
  }
  calibration->wheel_speed_noise =
      reader.InRange(wheel, "speed_noise", 1e-5, 20.0, "m/s");
  if (wheel["yaw_rate_noise"]) {
    calibration->wheel_yaw_rate_noise =
        reader.InRange(wheel, "yaw_rate_noise", 1e-6, 10.0, "rad/s");
  }
  calibration->imu_from_wheel = reader.Transform(wheel, "T_imu_wheel");
}

void ReadGnssSection(const CalibrationReader& reader, const YAML::Node& gnss,
                     SensorCalibration* calibration) {
  calibration->has_gnss = true;
  if (gnss["T_imu_gnss"]) {
    calibration->antenna_in_imu =
        reader.Transform(gnss, "T_imu_gnss").translation;
  } else {
    calibration->antenna_in_imu = reader.Vector(gnss, "p_imu_antenna");
  }
  calibration->timeshift_gnss_imu_s =
      reader.NumberOr(gnss, "timeshift_gnss_imu", 0.0);
  GnssNoise& noise = calibration->gnss_noise;
  if (gnss["horizontal_noise"]) {
    noise.horizontal_m =
        reader.InRange(gnss, "horizontal_noise", 1e-3, 100.0, "m");
    noise.vertical_m = 2.0 * noise.horizontal_m;
  }
  if (gnss["vertical_noise"]) {
    noise.vertical_m = reader.InRange(gnss, "vertical_noise", 1e-3, 1e3, "m");
  }
}

}  // namespace

StatusOr<SensorCalibration> ReadSensorCalibration(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return Status::Error(path + ": no such file; check the path");
  }
  try {
    std::ifstream stream(path);
    if (!stream) {
      return Status::Error(path + ": cannot be opened; check its permissions");
    }
    const YAML::Node root = YAML::Load(stream);
    const CalibrationReader reader(path);
    if (!root.IsMap()) reader.Fail("the file", "holds no YAML keys");
    SensorCalibration calibration;
    if (!root["cam0"] || !root["cam0"].IsMap()) {
      reader.Fail("cam0",
                  "is missing; add T_cam_imu (docs/reference/sensors.md)");
    }
    calibration.cam_from_imu = reader.Transform(root["cam0"], "T_cam_imu");
    calibration.timeshift_cam_imu_s =
        reader.NumberOr(root["cam0"], "timeshift_cam_imu", 0.0);
    ReadOtherCameras(reader, root, &calibration);
    if (root["imu0"] && root["imu0"].IsMap()) {
      ReadImuSection(reader, root["imu0"], &calibration);
    }
    if (root["wheel0"] && root["wheel0"].IsMap()) {
      ReadWheelSection(reader, root["wheel0"], &calibration);
    }
    if (root["gnss0"] && root["gnss0"].IsMap()) {
      ReadGnssSection(reader, root["gnss0"], &calibration);
    }
    return calibration;
  } catch (const YAML::Exception& exception) {
    return Status::Error(path + ", line " +
                         std::to_string(exception.mark.line + 1) +
                         ": not readable as YAML (" + OneLine(exception.msg) +
                         "); check indentation and brackets");
  } catch (const std::runtime_error& exception) {
    return Status::Error(OneLine(exception.what()));
  }
}

}  // namespace adasfm
