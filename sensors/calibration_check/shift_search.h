// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/calibration_check/calibration_mistakes.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/calibration_check/rotation_comparison.h"

namespace adasfm {

// A mistake (or none) at its best time shift.
struct Explanation {
  CalibrationMistake mistake;
  double shift_s = 0.0;
  // Of a low-pass filter in the gyroscope's log; see GyroscopeFilter.
  double lag_s = 0.0;
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
    return Compare(rotations_, shift_s, 0.0);
  }

  // Of up to two frames, where there are enough of them.
  RotationComparison CompareShortest(double shift_s) const {
    return Compare(short_rotations_, shift_s, 0.0);
  }

  // The best shift on a coarse grid for every explanation.
  void SearchShifts(std::vector<Explanation>* explanations) const;

  // To a tenth of a millisecond, about the coarse one. What the model leaves
  // out (a slightly turned T_cam_imu) grows with the interval and pulls on the
  // shift, so the shortest intervals decide where there are enough of them: of
  // up to two frames, or of one.
  void RefineShift(Explanation* explanation) const;
  void RefineShiftOfOneFrame(Explanation* explanation) const;

  // The filter's time constant, to a millisecond, and the shift that goes with
  // it, about the refined one.
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
  // The best shift and its cost for the explanation's lag, within a step of the
  // coarse grid of its shift.
  double FindShift(const Explanation& explanation,
                   const std::vector<TimedRotation>& rotations,
                   double* cost) const;
  void RefineShift(const std::vector<TimedRotation>& rotations,
                   Explanation* explanation) const;

  RateIntegral integral_;
  double timeshift_s_;
  VisionCheckOptions options_;
  std::vector<TimedRotation> rotations_;
  // All of them where there are too few short ones.
  std::vector<TimedRotation> short_rotations_;
  std::vector<TimedRotation> frame_rotations_;
};

// How much the cameras turn about the mean: rms of the visual rotations.
double ComputeTurningDeg(const RotationComparison& data);

}  // namespace adasfm
