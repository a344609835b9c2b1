// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "core/inertial_motion.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// The size of a model whose shape is known.
struct InertialScale {
  double metres_per_unit = 1.0;
  // 1 sigma of it, as a ratio.
  double sigma_ratio = 0.0;
};

// What: metres from an accelerometer, as visual-inertial odometry finds them at
// its start (Martinelli, IJCV 2014), with rotations that are known.
// Inputs: motions of consecutive images in order of time; poses, whose centres
// are right up to their size; motions of other images are passed over.
// Method. Within a window vision's centres are
//   p0 + v0 t + (g + d) t^2 / 2 + u (what the IMU integrated)
// in their own unit, u of it a metre. Linear in p0, v0 and d of each window,
// and in u, g and the accelerometer's bias of all. The errors are taken for
// vision's; as far as they are the IMU's they make u too small, which the sigma
// covers. d, about 0.6 deg of g, is what rotations drift and err; windows lose
// weight by their residuals. The jackknife counts windows as independent.
// The estimate is the mean over windows of 1, 2, ... 16 s, of which there are
// at least eight; its sigma has 0.2 % for the scales of the accelerometer's
// axes. Returns nothing where the size is not known to 20 %: without
// enough images, where the machine hardly changed its speed, and where gravity
// comes out of another size.
std::optional<InertialScale> EstimateInertialScale(
    const std::vector<InertialMotion>& motions,
    const std::map<image_t, Rigid3d>& cams_from_world);

}  // namespace adasfm
