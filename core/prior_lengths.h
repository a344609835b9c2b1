// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "core/relative_pose_prior.h"

namespace adasfm {

// The scale of the lengths in a wheel log, as an import estimated it.
struct WheelScale {
  double scale = 1.0;  // metres per logged metre
  double sigma = 0.0;  // 1 sigma of scale
  // 1 sigma of the scale 1 that is assumed before other sensors are used.
  double stated_sigma = 0.0;
};

// Whether any prior has a length, so that the scale is metric.
inline bool HasLengths(const std::vector<RelativePosePrior>& priors) {
  return std::any_of(
      priors.begin(), priors.end(),
      [](const RelativePosePrior& prior) { return prior.HasLength(); });
}

// Whether any prior has a length that a sensor measured, such as wheels.
inline bool HasMeasuredLengths(const std::vector<RelativePosePrior>& priors) {
  return std::any_of(
      priors.begin(), priors.end(), [](const RelativePosePrior& prior) {
        return prior.HasLength() && !(prior.flags & kPriorInertialLength);
      });
}

// HasLengths for the priors between images of a map or set only: lengths
// between other images, such as those of another coarse model, do not count.
template <typename Images>
bool HasLengthsBetween(const Images& images,
                       const std::vector<RelativePosePrior>& priors) {
  return std::any_of(
      priors.begin(), priors.end(), [&images](const RelativePosePrior& prior) {
        return prior.HasLength() && images.count(prior.image_id1) > 0 &&
               images.count(prior.image_id2) > 0;
      });
}

}  // namespace adasfm
