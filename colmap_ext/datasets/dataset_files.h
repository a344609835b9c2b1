// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/sensor_log.h"

namespace adasfm {

// Helpers to read the calibration files of known datasets. They throw faults of
// a file as std::runtime_error, with a message for the user.

// Throws unless the folder or a non-empty file exists at the path.
void RequireFile(const std::string& path);
bool PathExists(const std::string& path);

std::string ReadText(const std::string& path);

// All numbers of a text, in order; throws for any other word.
std::vector<double> NumbersFromText(const std::string& text,
                                    const std::string& path);

// "key: numbers" lines, as in KITTI's calibration files; lines with other
// values (dates) are skipped.
std::map<std::string, std::vector<double>> ReadKeyedNumbers(
    const std::string& path);
// The numbers of a key; throws when it is missing or has another count.
const std::vector<double>& FindNumbers(
    const std::map<std::string, std::vector<double>>& values,
    const std::string& key, size_t count, const std::string& path);

// Returns the matrix; throws unless it is a rotation.
Eigen::Matrix3d RequireRotation(const Eigen::Matrix3d& matrix,
                                const std::string& path);

// "a,b,c" with all digits.
std::string JoinNumbers(const std::vector<double>& numbers);

struct ImuDescription {
  double rate_hz = 200.0;
  ImuNoise noise;
};

// A calibration file of docs/reference/sensors.md.
std::string FormatSensorsYaml(const Rigid3d& cam_from_imu, double timeshift_s,
                              const ImuDescription& imu);

}  // namespace adasfm
