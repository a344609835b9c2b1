// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/keep_inertial_unit.h"

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/align_to_gravity.h"
#include "core/median.h"
#include "core/sim3d.h"

namespace adasfm {

void KeepInertialUnit(const std::vector<RelativePosePrior>& priors,
                      colmap::Reconstruction* reconstruction) {
  std::vector<WeightedValue> ratios;
  for (const RelativePosePrior& prior : priors) {
    const auto has_pose = [&](image_t image_id) {
      return reconstruction->ExistsImage(image_id) &&
             IsRegistered(*reconstruction, image_id);
    };
    if (!(prior.flags & kPriorInertialLength) || !has_pose(prior.image_id1) ||
        !has_pose(prior.image_id2)) {
      continue;
    }
    const double stated = prior.cam2_from_cam1.translation.norm();
    const double present =
        ComputeCam2FromCam1(
            CamFromWorld(reconstruction->Image(prior.image_id1)),
            CamFromWorld(reconstruction->Image(prior.image_id2)))
            .translation.norm();
    if (stated > 0.0 && present > 0.0) {
      ratios.push_back({stated / present, stated});
    }
  }
  if (ratios.empty()) return;
  TransformReconstruction(
      Sim3d(WeightedMedian(&ratios), Eigen::Quaterniond::Identity(),
            Eigen::Vector3d::Zero()),
      reconstruction);
}

}  // namespace adasfm
