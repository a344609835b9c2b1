// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/measure_size.h"

#include <cmath>
#include <map>
#include <optional>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/align_to_gravity.h"
#include "core/sim3d.h"
#include "core/so3.h"
#include "global/odometry/inertial_scale.h"

namespace adasfm {

std::vector<InertialLength> MeasureSize(
    const SceneData& scene, const std::map<ImagePair, Eigen::Matrix3d>& bridges,
    CoarseModel* model) {
  if (model->metric || scene.inertial_motions.empty()) return {};
  const std::optional<InertialScale> scale = EstimateInertialScale(
      scene.inertial_motions, CamsFromWorld(model->reconstruction));
  if (!scale) return {};
  model->metric = true;
  model->inertial_scale_sigma = scale->sigma_ratio;
  TransformReconstruction(
      Sim3d(scale->metres_per_unit, Eigen::Quaterniond::Identity(),
            Eigen::Vector3d::Zero()),
      &model->reconstruction);

  const std::map<image_t, Rigid3d> cams_from_world =
      CamsFromWorld(model->reconstruction);
  std::vector<InertialLength> lengths;
  double sum = 0.0;
  for (const RelativePosePrior& prior : scene.priors) {
    const auto pose1 = cams_from_world.find(prior.image_id1);
    const auto pose2 = cams_from_world.find(prior.image_id2);
    if (pose1 == cams_from_world.end() || pose2 == cams_from_world.end()) {
      continue;
    }
    InertialLength length;
    length.image_id1 = prior.image_id1;
    length.image_id2 = prior.image_id2;
    const Eigen::Vector3d translation =
        (pose2->second * pose1->second.Inverse()).translation;
    length.length_m = translation.norm();
    length.scale_sigma = scale->sigma_ratio;
    const auto bridge =
        bridges.find(ImagePair(prior.image_id1, prior.image_id2));
    if (bridge != bridges.end()) {
      length.bridge = MeasuredTranslation{translation, bridge->second};
    }
    sum += length.length_m * length.length_m;
    lengths.push_back(length);
  }
  for (InertialLength& length : lengths) length.sigma_m = std::sqrt(sum);
  return lengths;
}

}  // namespace adasfm
