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

// The metric scale of a model.
struct InertialScale {
  double metres_per_unit = 1.0;
  // 1 sigma of it, as a ratio.
  double sigma_ratio = 0.0;
};

// Estimates metres from an accelerometer, as visual-inertial odometry does at
// its start (Martinelli, IJCV 2014), with known rotations. motions: of
// consecutive images in order of time; motions of images without a pose are
// skipped. cams_from_world: centres must be right up to their scale.
//
// Within a window the visual centres are, in their own unit,
//   p0 + v0 t + (g + d) t^2 / 2 + u (what the IMU integrated)
// with u units per metre. This is linear in p0, v0 and d of each window, and in
// u, g and the accelerometer's bias of all. Errors are attributed to vision; as
// far as they are the IMU's, u becomes too small, which the sigma covers. d,
// about 0.6 deg of g, absorbs drift and errors of the rotations. Windows lose
// weight by their residuals. The jackknife counts windows as independent.
//
// The estimate is the mean over windows of 1, 2, ... 16 s, of which there are
// at least eight; its sigma includes 0.2 % for the scales of the
// accelerometer's axes. Returns nothing where the scale is not known to 20 %:
// without enough images, where the machine hardly changed its speed, and where
// the magnitude of gravity contradicts the scale.
std::optional<InertialScale> EstimateInertialScale(
    const std::vector<InertialMotion>& motions,
    const std::map<image_t, Rigid3d>& cams_from_world);

}  // namespace adasfm
