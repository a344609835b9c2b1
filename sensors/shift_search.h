// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_mistakes.h"
#include "sensors/check_against_vision.h"
#include "sensors/rotation_comparison.h"

namespace adasfm {

// A mistake (or none) at its best time shift.
struct Explanation {
  CalibrationMistake mistake;
  double shift_s = 0.0;
  RotationFit fit;
};

// Vision and gyroscope over the same intervals, at any time shift about the
// calibration's. Keeps a reference to the samples.
class ShiftSearch {
 public:
  ShiftSearch(const std::vector<TimedRotation>& rotations,
              const std::vector<ImuSample>& imu, double timeshift_s,
              const VisionCheckOptions& options)
      : integral_(imu), timeshift_s_(timeshift_s), options_(options) {
    SelectRotations(rotations);
  }

  // Of those that are short enough to compare.
  size_t num_rotations() const { return rotations_.size(); }

  RotationComparison Compare(double shift_s) const {
    return Compare(rotations_, shift_s);
  }

  // The best shift on a coarse grid for every explanation.
  void SearchShifts(std::vector<Explanation>* explanations) const;

  // To a tenth of a millisecond, about the coarse one. What the model leaves
  // out (a slightly turned T_cam_imu, a filter in the IMU) grows with the
  // interval and pulls on the shift, so the shortest intervals decide where
  // there are enough of them.
  void RefineShift(Explanation* explanation) const;

  // See ComputeEvidence; over the intervals that the log covers at both time
  // shifts.
  double Evidence(const Explanation& worse, const Explanation& better) const;

 private:
  void SelectRotations(const std::vector<TimedRotation>& rotations);
  RotationComparison Compare(const std::vector<TimedRotation>& rotations,
                             double shift_s) const;

  RateIntegral integral_;
  double timeshift_s_;
  VisionCheckOptions options_;
  std::vector<TimedRotation> rotations_;
  std::vector<TimedRotation> short_rotations_;
};

// How much the cameras turn about the mean: rms of the visual rotations.
double ComputeTurningDeg(const RotationComparison& data);

}  // namespace adasfm
