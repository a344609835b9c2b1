// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/prior_support.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kNumSigmas = 4.0;

struct Tolerances {
  double rotation_rad;
  // Over the prior's length; the tolerance is at least translation_m.
  double translation_ratio;
  double translation_m;
};
constexpr Tolerances kSupport = {0.05, 0.2, 0.1};
constexpr Tolerances kViolation = {0.1, 0.5, 0.5};

// The largest standard deviation of a 3x3 block's diagonal.
double MaxSigma(const Eigen::Matrix<double, 6, 6>& covariance, int begin) {
  return std::sqrt(
      std::max(0.0, covariance.diagonal().segment<3>(begin).maxCoeff()));
}

bool IsWithin(const Tolerances& tolerances, const RelativePosePrior& prior,
              const Rigid3d& cam2_from_cam1) {
  if (!prior.HasRotation() && !prior.HasDirection() && !prior.HasLength()) {
    return false;
  }
  if (prior.HasRotation()) {
    const double angle_rad =
        AngleBetweenRad(cam2_from_cam1.rotation, prior.cam2_from_cam1.rotation);
    if (angle_rad >
        tolerances.rotation_rad + kNumSigmas * MaxSigma(prior.covariance, 0)) {
      return false;
    }
  }
  const double prior_length = prior.cam2_from_cam1.translation.norm();
  const double length = cam2_from_cam1.translation.norm();
  if (!prior.HasLength()) return true;
  const double tolerance_m =
      std::max(tolerances.translation_m,
               tolerances.translation_ratio * prior_length) +
      kNumSigmas * MaxSigma(prior.covariance, 3);
  if (!prior.HasDirection()) {
    return std::abs(length - prior_length) <= tolerance_m;
  }
  return (cam2_from_cam1.translation - prior.cam2_from_cam1.translation)
             .norm() <= tolerance_m;
}

}  // namespace

bool IsSupportedByPrior(const RelativePosePrior& prior,
                        const Rigid3d& cam2_from_cam1) {
  return IsWithin(kSupport, prior, cam2_from_cam1);
}

std::optional<bool> IsViolated(const RelativePosePrior& prior,
                               const colmap::Reconstruction& model) {
  const auto has = [&model](image_t image_id) {
    return model.ExistsImage(image_id) && IsRegistered(model, image_id);
  };
  constexpr uint32_t kTested = kPriorRotation | kPriorLength;
  if (prior.flags & kPriorWheelSlip || !(prior.flags & kTested) ||
      !has(prior.image_id1) || !has(prior.image_id2)) {
    return std::nullopt;
  }
  return !IsWithin(
      kViolation, prior,
      ComputeCam2FromCam1(CamFromWorld(model.Image(prior.image_id1)),
                          CamFromWorld(model.Image(prior.image_id2))));
}

}  // namespace adasfm
