// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/calibration_mistakes.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/calibration_check/rotation_comparison.h"

namespace adasfm {

// With fewer compared rotations the check is not conclusive.
inline constexpr size_t kMinNumRotations = 10;

// A mistake (or none) at its best time shift.
struct Explanation {
  CalibrationMistake mistake;
  double shift_s = 0.0;
  // Of a low-pass filter in the gyroscope's log; see GyroscopeFilter.
  double lag_s = 0.0;
  RotationFit fit;
};

// Compares vision and gyroscope over the same intervals, at time shifts
// relative to the calibration's. Keeps a reference to the samples.
class ShiftSearch {
 public:
  ShiftSearch(const std::vector<TimedRotation>& rotations,
              const std::vector<ImuSample>& imu, double timeshift_s)
      : integral_(imu), timeshift_s_(timeshift_s) {
    SelectRotations(rotations);
  }

  // Number of compared rotations, which are short enough and thinned out.
  size_t num_rotations() const { return rotations_.size(); }

  RotationComparison Compare(double shift_s) const {
    return Compare(rotations_, shift_s, 0.0);
  }

  // Over intervals of up to two frames, where there are enough of them.
  RotationComparison CompareShortest(double shift_s) const {
    return Compare(short_rotations_, shift_s, 0.0);
  }

  // The best shift on a coarse grid for every explanation.
  void SearchShifts(std::vector<Explanation>* explanations) const;

  // Refines the coarse shift to a tenth of a millisecond. Model errors (a small
  // rotation error of T_cam_imu) grow with the interval and bias the shift, so
  // the shortest intervals decide where there are enough of them: of up to two
  // frames, or of one.
  void RefineShift(Explanation* explanation) const;
  void RefineShiftOfOneFrame(Explanation* explanation) const;

  // Finds the filter's time constant to a millisecond, and the time shift for
  // it, near the refined shift.
  void RefineLag(Explanation* explanation) const;

  // See ComputeEvidence; over the intervals that the log covers at both time
  // shifts.
  double Evidence(const Explanation& worse, const Explanation& better) const;

 private:
  void SelectRotations(const std::vector<TimedRotation>& rotations);
  bool IsCovered(const TimedRotation& rotation, timestamp_t shift_ns) const;
  size_t CountCovered(double shift_s) const;
  RotationComparison Compare(const std::vector<TimedRotation>& rotations,
                             double shift_s, double lag_s) const;
  // The best shift for the explanation's lag and its cost, within a coarse grid
  // step of the explanation's shift.
  double FindShift(const Explanation& explanation,
                   const std::vector<TimedRotation>& rotations,
                   double* cost) const;
  void RefineShift(const std::vector<TimedRotation>& rotations,
                   Explanation* explanation) const;

  RateIntegral integral_;
  double timeshift_s_;
  std::vector<TimedRotation> rotations_;
  // All of rotations_ where too few are short.
  std::vector<TimedRotation> short_rotations_;
  std::vector<TimedRotation> frame_rotations_;
};

// Rms of the visual rotations about their mean, deg.
double ComputeTurningDeg(const RotationComparison& data);

}  // namespace adasfm
