// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/calibration_mistakes.h"

#include <algorithm>
#include <array>

#include "core/so3.h"

namespace adasfm {
std::string AxesToString(const Eigen::Matrix3d& axes) {
  const char* names = "xyz";
  std::string text;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      if (axes(row, column) == 0.0) continue;
      if (!text.empty()) text += ", ";
      text += names[row];
      text += axes(row, column) < 0.0 ? " = -" : " = ";
      text += names[column];
    }
  }
  return text;
}

std::vector<CalibrationMistake> ListCalibrationMistakes(
    const Eigen::Matrix3d& cam_from_imu) {
  std::vector<CalibrationMistake> list(3);
  list[0].map = cam_from_imu;
  list[1].kind = CalibrationMistake::kDegrees;
  list[1].map = DegToRad(1.0) * cam_from_imu;
  list[2].kind = CalibrationMistake::kInverted;
  list[2].map = cam_from_imu.transpose();
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      CalibrationMistake mistake;
      mistake.kind = CalibrationMistake::kAxes;
      mistake.axes.setZero();
      for (int row = 0; row < 3; ++row) {
        mistake.axes(row, order[row]) = (signs >> row) & 1 ? -1.0 : 1.0;
      }
      if (mistake.axes.isIdentity()) continue;
      mistake.map = cam_from_imu * mistake.axes;
      list.push_back(mistake);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  std::stable_sort(
      list.begin() + 3, list.end(),
      [](const CalibrationMistake& a, const CalibrationMistake& b) {
        return a.axes.trace() > b.axes.trace();
      });
  return list;
}

std::string DescribeMistake(const CalibrationMistake& mistake) {
  switch (mistake.kind) {
    case CalibrationMistake::kNone:
      return "";
    case CalibrationMistake::kDegrees:
      return "angular velocities look like deg/s: multiply them by pi / 180 "
             "(rad/s are expected)";
    case CalibrationMistake::kInverted:
      return "T_cam_imu looks inverted (it seems to be T_imu_cam): invert the "
             "matrix";
    case CalibrationMistake::kAxes:
      return "the IMU's axes do not fit T_cam_imu: vision fits when the log's "
             "axes are read as " +
             AxesToString(mistake.axes);
  }
  return "";
}

}  // namespace adasfm
