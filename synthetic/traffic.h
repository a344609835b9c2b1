// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "synthetic/synthetic_world.h"

namespace adasfm {

// Two cars that drive ahead of the camera, one in its lane and one in the next,
// at slowly changing distances and with the heading of the camera's car. They
// occlude nothing.
inline constexpr int kNumCars = 2;
inline constexpr int kNumPointsPerCar = 1000;

// Car k has the points kNumPointsPerCar * k and so on.
inline int CarOfPoint(int point) { return point / kNumPointsPerCar; }

// Puts options.moving_keypoint_ratio of each image's keypoints onto the cars.
void AddTraffic(SyntheticWorld* world);

}  // namespace adasfm
