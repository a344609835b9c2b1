// SPDX-License-Identifier: BSD-3-Clause
#include <time.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "colmap_ext/datasets/dataset_files.h"
#include "colmap_ext/datasets/dataset_layout.h"
#include "core/strict_stream.h"
#include "core/types.h"

namespace adasfm {
namespace {

using KeyedNumbers = std::map<std::string, std::vector<double>>;
using ProjectionMatrix = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// Suffix of the left colour camera's folder if it exists, else of the left grey
// one.
std::string FindCamera(const std::string& root, const std::string& colour,
                       const std::string& grey) {
  return PathExists(root + "/image_" + colour) ? colour : grey;
}

// The numbered images of a folder, sorted by name; skips files that a file
// manager left there.
std::vector<std::string> ListImages(const std::string& folder) {
  RequireFile(folder);
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name[0] >= '0' && name[0] <= '9') {
      names.push_back(name);
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

// PINHOLE of the rectified images. KITTI has pixel centres at whole numbers,
// COLMAP at .5.
void SetCamera(const ProjectionMatrix& projection, DatasetLayout* layout) {
  layout->camera_model = "PINHOLE";
  layout->camera_params =
      JoinNumbers({projection(0, 0), projection(1, 1), projection(0, 2) + 0.5,
                   projection(1, 2) + 0.5});
}

// Nine numbers, row by row.
Eigen::Matrix3d ToRotation(const std::vector<double>& numbers,
                           const std::string& path) {
  return RequireRotation(
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(
          numbers.data()),
      path);
}

Rigid3d ReadRigid(const std::string& path) {
  const KeyedNumbers values = ReadKeyedNumbers(path);
  const std::vector<double>& rotation = FindNumbers(values, "R", 9, path);
  const std::vector<double>& translation = FindNumbers(values, "T", 3, path);
  return Rigid3d(ToRotation(rotation, path),
                 Eigen::Vector3d(translation.data()));
}

ProjectionMatrix ToProjection(const std::vector<double>& numbers) {
  return Eigen::Map<const ProjectionMatrix>(numbers.data());
}

// "2011-09-26 13:02:25.964389445"; counted from 1970, as the IMU's times.
timestamp_t ParseTime(const std::string& line, const std::string& path) {
  struct tm date = {};
  int64_t nanoseconds = 0;
  char fraction[16] = "";
  if (std::sscanf(line.c_str(), "%d-%d-%d %d:%d:%d.%9[0-9]", &date.tm_year,
                  &date.tm_mon, &date.tm_mday, &date.tm_hour, &date.tm_min,
                  &date.tm_sec, fraction) < 6) {
    throw std::runtime_error(path + ": '" + line +
                             "' is not 'YYYY-MM-DD hh:mm:ss.fraction'");
  }
  date.tm_year -= 1900;
  date.tm_mon -= 1;
  const std::string digits = (std::string(fraction) + "000000000").substr(0, 9);
  nanoseconds = std::stoll(digits);
  return static_cast<timestamp_t>(timegm(&date)) * 1'000'000'000 + nanoseconds;
}

std::vector<timestamp_t> ReadTimes(const std::string& path) {
  std::istringstream lines(ReadText(path));
  ThrowOnFailure(&lines);
  std::vector<timestamp_t> times;
  for (std::string line; std::getline(lines, line);) {
    if (line.size() > 1) times.push_back(ParseTime(line, path));
  }
  return times;
}

// Synchronised drives have 10 Hz, others 100 Hz.
double ImuRateHz(const std::string& times_path) {
  const std::vector<timestamp_t> times = ReadTimes(times_path);
  const double duration_s =
      times.empty() ? 0.0 : SecondsFromNs(times.back() - times.front());
  if (!(duration_s > 0.0)) {
    throw std::runtime_error(times_path + " has fewer than two times");
  }
  return (times.size() - 1) / duration_s;
}

// "ns,name" lines. A photo's name is its number in the complete drive; its time
// is in the line of this number.
std::string BuildImageTimes(const std::string& times_path,
                            const std::string& image_path) {
  const std::vector<timestamp_t> times = ReadTimes(times_path);
  std::ostringstream text;
  text << "#timestamp [ns],filename\n";
  for (const std::string& name : ListImages(image_path)) {
    const size_t index = std::strtoul(name.c_str(), nullptr, 10);
    if (index >= times.size()) {
      throw std::runtime_error(times_path + " has " +
                               std::to_string(times.size()) +
                               " lines, none for the photo " + name);
    }
    text << times[index] << "," << name << "\n";
  }
  return text.str();
}

// x_rect = R_rect x_cam0, shifted by the camera's baseline, which the last
// column of its projection matrix gives in pixels.
Rigid3d RectifiedFromCam0(const KeyedNumbers& values, const std::string& camera,
                          const std::string& path,
                          const ProjectionMatrix& projection) {
  const std::vector<double>& rotation =
      FindNumbers(values, "R_rect_00", 9, path);
  const Eigen::Matrix3d calibration = projection.leftCols<3>();
  if (!(std::abs(calibration.determinant()) > 0.0)) {
    throw std::runtime_error(path + ": P_rect_" + camera + " is singular");
  }
  return Rigid3d(ToRotation(rotation, path),
                 Eigen::Vector3d(calibration.inverse() * projection.col(3)));
}

}  // namespace

StatusOr<DatasetLayout> FindKittiRawLayout(const std::string& root) {
  DatasetLayout layout;
  const std::string camera = FindCamera(root, "02", "00");
  const std::string folder = root + "/image_" + camera;
  layout.image_path = folder + "/data";
  layout.imu_path = root + "/oxts";
  layout.image_times_text =
      BuildImageTimes(folder + "/timestamps.txt", layout.image_path);
  // The calibration belongs to the day, whose folder contains the drives.
  const std::string day =
      PathExists(root + "/calib_cam_to_cam.txt") ? root : root + "/..";
  const std::string camera_path = day + "/calib_cam_to_cam.txt";
  const KeyedNumbers values = ReadKeyedNumbers(camera_path);
  const ProjectionMatrix projection =
      ToProjection(FindNumbers(values, "P_rect_" + camera, 12, camera_path));
  SetCamera(projection, &layout);
  const Rigid3d cam_from_imu =
      RectifiedFromCam0(values, camera, camera_path, projection) *
      ReadRigid(day + "/calib_velo_to_cam.txt") *
      ReadRigid(day + "/calib_imu_to_velo.txt");
  ImuDescription imu;
  imu.rate_hz = ImuRateHz(layout.imu_path + "/timestamps.txt");
  layout.imu_period_s = 1.0 / imu.rate_hz;
  layout.sensors_text = FormatSensorsYaml(cam_from_imu, 0.0, imu);
  return layout;
}

StatusOr<DatasetLayout> FindKittiOdometryLayout(const std::string& root) {
  DatasetLayout layout;
  const std::string camera = FindCamera(root, "2", "0");
  layout.image_path = root + "/image_" + camera;
  const std::string calibration_path = root + "/calib.txt";
  const KeyedNumbers values = ReadKeyedNumbers(calibration_path);
  SetCamera(
      ToProjection(FindNumbers(values, "P" + camera, 12, calibration_path)),
      &layout);
  // times.txt has one line per photo, in seconds.
  const std::string times_path = root + "/times.txt";
  const std::vector<double> times =
      NumbersFromText(ReadText(times_path), times_path);
  const std::vector<std::string> names = ListImages(layout.image_path);
  std::ostringstream text;
  text << "#timestamp [ns],filename\n";
  for (const std::string& name : names) {
    const size_t index = std::strtoul(name.c_str(), nullptr, 10);
    if (index >= times.size()) {
      throw std::runtime_error(times_path + " has no line for the photo " +
                               name);
    }
    text << static_cast<timestamp_t>(times[index] * 1e9) << "," << name << "\n";
  }
  layout.image_times_text = text.str();
  return layout;
}

}  // namespace adasfm
