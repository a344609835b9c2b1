// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// What a prior's sensors observed. What is not observed has an infinite
// variance and its value must not be used.
enum PriorFlags : uint32_t {
  kPriorRotation = 1u << 0,
  kPriorDirection = 1u << 1,  // of the translation
  kPriorLength = 1u << 2,     // of the translation, in metres
  kPriorWheelSlip = 1u << 3,  // wheels contradicted the IMU: weights are low
  // Its length is in metres of the accelerometer. Without a direction it is
  // vision's: no measurement of this motion alone.
  kPriorInertialLength = 1u << 4,
};

// The motion between two images as the sensors saw it.
// image_id1 is the earlier one.
struct RelativePosePrior {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  timestamp_t dt_ns = 0;
  // P_12, translation in metres.
  Rigid3d cam2_from_cam1;
  // Of (rotation, translation), both in the frame of camera 2: the true motion
  // is R_true = Exp(dtheta) R, t_true = t + dt, (dtheta, dt) ~ N(0,
  // covariance). Units rad^2, rad m, m^2; infinity on the diagonal where not
  // observed.
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6, 6>::Identity();
  uint32_t flags = 0;

  bool HasRotation() const { return flags & kPriorRotation; }
  bool HasDirection() const { return flags & kPriorDirection; }
  bool HasLength() const { return flags & kPriorLength; }
  bool HasTranslation() const { return HasDirection() && HasLength(); }
  bool HasMotion() const { return HasRotation() && HasTranslation(); }
  // Of this motion alone.
  bool HasOwnLength() const {
    return HasTranslation() || (HasLength() && !(flags & kPriorInertialLength));
  }
};

}  // namespace adasfm
