// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/find_sensor_corrections.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace adasfm {
namespace {

// Smaller corrections are left to the same unknowns of the mapper's
// adjustments.
constexpr double kMinShiftS = 1e-3;
constexpr double kMinGyroscopeScale = 5e-3;

std::vector<const SharedErrors*> LastSharedErrors(
    const std::vector<CoarseModel>& models) {
  std::vector<const SharedErrors*> errors;
  for (const CoarseModel& model : models) {
    if (model.rounds.empty() || !model.rounds.back().success) continue;
    errors.push_back(&model.rounds.back().shared_errors);
  }
  return errors;
}

}  // namespace

TimeShiftMap FindTimeShifts(const std::vector<CoarseModel>& models) {
  TimeShiftMap shifts;
  for (const SharedErrors* errors : LastSharedErrors(models)) {
    for (const auto& [drive, shift_s] : errors->time_shift) {
      if (std::abs(shift_s) >= kMinShiftS) shifts.emplace(drive, shift_s);
    }
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
  for (const SharedErrors* errors : LastSharedErrors(models)) {
    for (const auto& [drive, scale] : errors->gyroscope_scale) {
      const Eigen::Matrix3d matrix = errors->GyroscopeScales(drive);
      if (matrix.cwiseAbs().maxCoeff() >= kMinGyroscopeScale) {
        scales.emplace(drive, matrix);
      }
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
  for (const auto& [drive, matrix] : scales) {
    text << (text.tellp() > 0 ? "; " : "");
    for (int axis = 0; axis < 3; ++axis) {
      text << (axis > 0 ? ", " : "") << 100.0 * matrix(axis, axis) << " %";
    }
  }
  text << " added to the rates about the camera's x, y, z";
  return text.str();
}

}  // namespace adasfm
