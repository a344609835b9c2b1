// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "core/relative_pose_prior.h"

namespace adasfm {

// What an import found of the size of the lengths that wheels log.
struct WheelScale {
  double scale = 1.0;  // metres a logged metre
  double sigma = 0.0;  // 1 sigma of it
  // Believed of 1 before any other sensor was asked.
  double stated_sigma = 0.0;
};

// Whether any of the priors knows a length, and with it the metre.
inline bool HasLengths(const std::vector<RelativePosePrior>& priors) {
  return std::any_of(
      priors.begin(), priors.end(),
      [](const RelativePosePrior& prior) { return prior.HasLength(); });
}

// Whether a sensor measured any of them, such as wheels.
inline bool HasMeasuredLengths(const std::vector<RelativePosePrior>& priors) {
  return std::any_of(
      priors.begin(), priors.end(), [](const RelativePosePrior& prior) {
        return prior.HasLength() && !(prior.flags & kPriorInertialLength);
      });
}

// The same as HasLengths of the priors between images of a map or set: lengths
// between other images, such as those of another coarse model, say nothing.
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
