// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "sensors/calibration_check/check_against_vision.h"

namespace adasfm {

// Two-view rotations among three images: a right one closes with two others, a
// wrong one hardly ever does.
class RotationTriples {
 public:
  // Keeps a reference.
  explicit RotationTriples(const std::vector<TimedRotation>& rotations);

  // Whether the rotation and those of both its images to a third one make less
  // than max_angle_rad together, for any third image.
  bool Closes(const TimedRotation& rotation, double max_angle_rad) const;

 private:
  // cam2_from_cam1 of a pair in either order; null where there is none.
  const TimedRotation* Find(timestamp_t time1_ns, timestamp_t time2_ns) const;

  std::map<std::pair<timestamp_t, timestamp_t>, const TimedRotation*> pairs_;
  std::map<timestamp_t, std::vector<timestamp_t>> partners_;
};

}  // namespace adasfm
