// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/evaluation/relative_pose_auc.h"

#include <algorithm>

#include "core/so3.h"

namespace adasfm {

void RelativePoseAucCounter::Sums::Add(double error_deg) {
  ++count;
  for (size_t k = 0; k < areas.size(); ++k) {
    areas[k] += std::max(0.0, 1.0 - error_deg / kThresholdsDeg[k]);
  }
}

double RelativePoseAucCounter::Sums::Percent(size_t k) const {
  return count == 0 ? 0.0 : 100.0 * areas[k] / count;
}

void RelativePoseAucCounter::Add(const Rigid3d& cam2_from_cam1,
                                 const Rigid3d& true_cam2_from_cam1) {
  rotations_.Add(RadToDeg(
      AngleBetweenRad(cam2_from_cam1.rotation, true_cam2_from_cam1.rotation)));
  if (true_cam2_from_cam1.translation.isZero()) return;
  directions_.Add(
      cam2_from_cam1.translation.isZero()
          ? 180.0
          : RadToDeg(AngleBetweenRad(cam2_from_cam1.translation,
                                     true_cam2_from_cam1.translation)));
}

std::vector<RelativePoseAuc> RelativePoseAucCounter::Result() const {
  std::vector<RelativePoseAuc> auc;
  for (size_t k = 0; k < kThresholdsDeg.size(); ++k) {
    auc.push_back(
        {kThresholdsDeg[k], rotations_.Percent(k), directions_.Percent(k)});
  }
  return auc;
}

}  // namespace adasfm
