// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/georeference.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/scene/align_to_gravity.h"
#include "core/prior_lengths.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// 1 sigma of the vertical from accelerometers over a drive: a remaining bias of
// 0.03 m/s^2, and a wrong extrinsic rotation whose effect averages out as the
// machine turns.
constexpr double kDriveGravitySigmaRad = DegToRad(0.2);
constexpr double kDriveUprightSigmaRad = DegToRad(10.0);
// Residuals within this many sigmas need no wider loss.
constexpr double kNarrowLossSigmas = 4.0;

}  // namespace

bool HasMetricPriors(const SceneData& scene,
                     const std::map<image_t, Rigid3d>& cams_from_world) {
  return HasLengthsBetween(cams_from_world, scene.priors) ||
         HasLengthsBetween(cams_from_world, scene.frame_priors);
}

PositionAlignment AlignSceneToPositions(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world,
    bool is_metric) {
  PositionAlignmentInput input;
  input.positions = scene.positions;
  input.cams_from_world = cams_from_world;
  input.is_metric = is_metric;
  input.down_in_world = FindGravityInWorld(scene, cams_from_world);
  return AlignToPositions(input);
}

std::map<image_t, Rigid3d> TransformCamsFromWorld(
    const Sim3d& enu_from_world,
    const std::map<image_t, Rigid3d>& cams_from_world) {
  std::map<image_t, Rigid3d> transformed;
  for (const auto& [image_id, pose] : cams_from_world) {
    transformed[image_id] = TransformCamFromWorld(enu_from_world, pose);
  }
  return transformed;
}

Verticals FindVerticals(const SceneData& scene,
                        const std::map<image_t, Rigid3d>& cams_from_enu) {
  Verticals verticals;
  verticals.sigma_rad = kDriveGravitySigmaRad;
  for (const auto& [image_id, pose] : cams_from_enu) {
    const auto image = scene.images.find(image_id);
    if (image == scene.images.end() || !image->second.gravity_in_cam) continue;
    verticals.gravity_in_cam[image_id] = *image->second.gravity_in_cam;
  }
  if (!verticals.gravity_in_cam.empty()) return verticals;
  verticals.sigma_rad = kDriveUprightSigmaRad;
  for (const auto& [image_id, pose] : cams_from_enu) {
    verticals.gravity_in_cam[image_id] =
        pose.rotation * -Eigen::Vector3d::UnitZ();
  }
  return verticals;
}

double PositionLossScale(const PositionAlignment& alignment, double final_scale,
                         int round, int num_rounds) {
  if (num_rounds < 2) return final_scale;
  const double widening =
      std::max(1.0, alignment.threshold_sigmas / kNarrowLossSigmas);
  const double share_left = 1.0 - static_cast<double>(round) / (num_rounds - 1);
  return final_scale * std::pow(widening, std::max(0.0, share_left));
}

}  // namespace adasfm
