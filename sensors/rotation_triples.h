// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "sensors/calibration_check/check_against_vision.h"

namespace adasfm {

// Loops of two-view rotations among three images: a correct rotation closes
// with two others, a wrong one hardly ever does.
class RotationTriples {
 public:
  // Keeps pointers into `rotations`.
  explicit RotationTriples(const std::vector<TimedRotation>& rotations);

  // Whether, for any third image, the loop of the rotation and those of its two
  // images to the third has an angle below max_angle_rad.
  bool Closes(const TimedRotation& rotation, double max_angle_rad) const;

 private:
  // The rotation of a pair in either order; null where there is none.
  const TimedRotation* Find(timestamp_t time1_ns, timestamp_t time2_ns) const;

  std::map<std::pair<timestamp_t, timestamp_t>, const TimedRotation*> pairs_;
  std::map<timestamp_t, std::vector<timestamp_t>> partners_;
};

}  // namespace adasfm
