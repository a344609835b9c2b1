// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/find_sensor_corrections.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>

namespace adasfm {
namespace {

// Smaller corrections are left to the same unknowns of the mapper's
// adjustments.
constexpr double kMinShiftS = 1e-3;
constexpr double kMinGyroscopeScale = 5e-3;

// By drive, the errors that its first model has.
std::map<int, const SharedErrors*> FindSharedErrors(
    const std::vector<CoarseModel>& models) {
  std::map<int, const SharedErrors*> by_drive;
  for (const CoarseModel& model : models) {
    if (model.rounds.empty() || !model.rounds.back().success) continue;
    const SharedErrors& errors = model.rounds.back().shared_errors;
    // All rotations of a drive depend on it.
    for (const auto& [drive, scale] : errors.gyroscope_scale) {
      by_drive.emplace(drive, &errors);
    }
  }
  return by_drive;
}

}  // namespace

TimeShiftMap FindTimeShifts(const std::vector<CoarseModel>& models) {
  TimeShiftMap shifts;
  for (const auto& [drive, errors] : FindSharedErrors(models)) {
    const auto shift = errors->time_shift.find(drive);
    if (shift == errors->time_shift.end()) continue;
    if (std::abs(shift->second) >= kMinShiftS) shifts.insert(*shift);
  }
  return shifts;
}

GyroscopeScaleMap FindGyroscopeScales(const std::vector<CoarseModel>& models) {
  // A wrong focal length passes for such scales.
  if (std::any_of(models.begin(), models.end(), [](const CoarseModel& model) {
        return model.focal_length_error && !model.cameras_refined;
      })) {
    return {};
  }
  GyroscopeScaleMap scales;
  for (const auto& [drive, errors] : FindSharedErrors(models)) {
    const Eigen::Vector3d& scale = errors->gyroscope_scale.at(drive);
    if (scale.cwiseAbs().maxCoeff() >= kMinGyroscopeScale) {
      scales.emplace(drive, scale);
    }
  }
  return scales;
}

std::string DescribeTimeShifts(const TimeShiftMap& shifts) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(4) << std::showpos;
  for (const auto& [drive, shift_s] : shifts) {
    text << (text.tellp() > 0 ? ", " : "") << shift_s << " s";
  }
  text << " added to timeshift_cam_imu";
  return text.str();
}

std::string DescribeGyroscopeScales(const GyroscopeScaleMap& scales) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << std::showpos;
  for (const auto& [drive, scale] : scales) {
    text << (text.tellp() > 0 ? "; " : "") << 100.0 * scale.x() << " %, "
         << 100.0 * scale.y() << " %, " << 100.0 * scale.z() << " %";
  }
  text << " added to the rates about the camera's x, y, z";
  return text.str();
}

}  // namespace adasfm
