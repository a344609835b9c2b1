// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/dataset_files.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "core/strict_stream.h"

namespace adasfm {
namespace {

bool ParseNumber(const std::string& word, double* value) {
  char* end = nullptr;
  *value = std::strtod(word.c_str(), &end);
  return end != word.c_str() && *end == '\0' && std::isfinite(*value);
}

}  // namespace

bool PathExists(const std::string& path) {
  std::error_code error;
  return std::filesystem::exists(path, error);
}

void RequireFile(const std::string& path) {
  std::error_code error;
  if (std::filesystem::file_size(path, error) == 0 && !error) {
    throw std::runtime_error(path + " is empty");
  }
  if (PathExists(path)) return;
  throw std::runtime_error(path +
                           " is missing; is --image_path the recording's root "
                           "folder, and --data_format its format?");
}

std::string ReadText(const std::string& path) {
  RequireFile(path);
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file || text.empty()) {
    throw std::runtime_error(path + " is empty or cannot be read");
  }
  return text;
}

std::vector<double> NumbersFromText(const std::string& text,
                                    const std::string& path) {
  std::istringstream words(text);
  ThrowOnFailure(&words);
  std::vector<double> numbers;
  for (std::string word; words >> word;) {
    double value = 0.0;
    if (!ParseNumber(word, &value)) {
      throw std::runtime_error(path + ": '" + word + "' is not a number");
    }
    numbers.push_back(value);
  }
  return numbers;
}

std::map<std::string, std::vector<double>> ReadKeyedNumbers(
    const std::string& path) {
  std::istringstream lines(ReadText(path));
  ThrowOnFailure(&lines);
  std::map<std::string, std::vector<double>> values;
  for (std::string line; std::getline(lines, line);) {
    const size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    try {
      values[line.substr(0, colon)] =
          NumbersFromText(line.substr(colon + 1), path);
    } catch (const std::runtime_error&) {
      // A date, as in "calib_time: 09-Jan-2012 13:57:47".
    }
  }
  return values;
}

const std::vector<double>& FindNumbers(
    const std::map<std::string, std::vector<double>>& values,
    const std::string& key, size_t count, const std::string& path) {
  const auto entry = values.find(key);
  if (entry == values.end() || entry->second.size() != count) {
    throw std::runtime_error(path + ": no line '" + key + ":' with " +
                             std::to_string(count) + " numbers");
  }
  return entry->second;
}

Eigen::Matrix3d RequireRotation(const Eigen::Matrix3d& matrix,
                                const std::string& path) {
  if (!(matrix * matrix.transpose()).isIdentity(1e-3) ||
      !(matrix.determinant() > 0.0)) {
    throw std::runtime_error(path + ": a transform is not a rotation");
  }
  return matrix;
}

std::string JoinNumbers(const std::vector<double>& numbers) {
  std::ostringstream text;
  text << std::setprecision(17);
  for (size_t i = 0; i < numbers.size(); ++i) {
    text << (i == 0 ? "" : ",") << numbers[i];
  }
  return text.str();
}

std::string FormatSensorsYaml(const Rigid3d& cam_from_imu, double timeshift_s,
                              const ImuDescription& imu) {
  std::ostringstream text;
  text << std::setprecision(17) << "cam0:\n  T_cam_imu:\n";
  const Eigen::Matrix<double, 3, 4> matrix = cam_from_imu.ToMatrix();
  for (int i = 0; i < 3; ++i) {
    text << "    - [" << matrix(i, 0) << ", " << matrix(i, 1) << ", "
         << matrix(i, 2) << ", " << matrix(i, 3) << "]\n";
  }
  text << "    - [0, 0, 0, 1]\n  timeshift_cam_imu: " << timeshift_s
       << "\nimu0:\n  update_rate: " << imu.rate_hz << "\n";
  text << "  gyroscope_noise_density: " << imu.noise.gyroscope_noise_density
       << "\n  gyroscope_random_walk: " << imu.noise.gyroscope_random_walk
       << "\n  accelerometer_noise_density: "
       << imu.noise.accelerometer_noise_density
       << "\n  accelerometer_random_walk: "
       << imu.noise.accelerometer_random_walk << "\n";
  return text.str();
}

}  // namespace adasfm
