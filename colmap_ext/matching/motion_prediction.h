// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// The motion between two images, predicted before they are matched.
struct PredictedMotion {
  Rigid3d cam2_from_cam1;  // metres
  // Defined as RelativePosePrior::covariance.
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6, 6>::Identity();
};

// None for images without a prediction. Called from several threads.
using MotionPredictor =
    std::function<std::optional<PredictedMotion>(const ImagePair&)>;

}  // namespace adasfm
