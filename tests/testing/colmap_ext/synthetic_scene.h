// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/random.h"
#include "core/sim3d.h"
#include "core/so3.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// A synthetic world as it would be read from its database, and its priors: the
// true motion of consecutive images with errors of the stated sigmas.
struct SyntheticPriorOptions {
  bool enabled = true;
  double rotation_sigma_rad = 5e-4;
  double translation_sigma_m = 0.01;
};

inline SceneData BuildSyntheticScene(const SyntheticWorld& world,
                                     const SyntheticPriorOptions& options) {
  SceneData scene;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.SetWidth(world.camera.width);
  camera.SetHeight(world.camera.height);
  std::vector<double> params = {world.camera.focal_px, world.camera.focal_px,
                                world.camera.principal_x_px,
                                world.camera.principal_y_px};
  if (world.camera.model == SyntheticCameraModel::kFisheye) {
    camera.SetModelIdFromName("OPENCV_FISHEYE");
    for (const double k : world.camera.fisheye_coeffs) params.push_back(k);
  } else {
    camera.SetModelIdFromName("PINHOLE");
  }
  camera.SetParams(params);
  camera.SetPriorFocalLength(true);
  scene.cameras[1] = camera;
  for (const SyntheticImage& image : world.images) {
    SceneImage& target = scene.images[image.image_id];
    target.image_id = image.image_id;
    target.camera_id = 1;
    target.name = image.name;
    target.keypoints = image.keypoints;
    target.timestamp_ns = image.timestamp_ns;
    if (options.enabled) {
      target.gravity_in_cam =
          image.cam_from_world.rotation * -Eigen::Vector3d::UnitZ();
    }
  }
  for (const SyntheticPair& pair : world.pairs) {
    ScenePair target;
    target.image_id1 = pair.image_id1;
    target.image_id2 = pair.image_id2;
    target.config = 2;  // calibrated
    target.inlier_matches = pair.inlier_matches;
    target.raw_matches = pair.raw_matches;
    target.cam2_from_cam1 = pair.cam2_from_cam1;
    if (pair.inlier_matches.size() >= 15) scene.pairs.push_back(target);
  }
  if (!options.enabled) return scene;
  Random random(world.options.seed);
  for (size_t i = 0; i + 1 < world.images.size(); ++i) {
    const SyntheticImage& image1 = world.images[i];
    const SyntheticImage& image2 = world.images[i + 1];
    const Rigid3d truth =
        ComputeCam2FromCam1(image1.cam_from_world, image2.cam_from_world);
    RelativePosePrior prior;
    prior.image_id1 = image1.image_id;
    prior.image_id2 = image2.image_id;
    prior.dt_ns = image2.timestamp_ns - image1.timestamp_ns;
    prior.cam2_from_cam1 = Rigid3d(
        ExpSo3(random.GaussianVector(options.rotation_sigma_rad)) *
            truth.rotation,
        truth.translation + random.GaussianVector(options.translation_sigma_m));
    prior.covariance.setZero();
    prior.covariance.diagonal().head<3>().setConstant(
        options.rotation_sigma_rad * options.rotation_sigma_rad);
    prior.covariance.diagonal().tail<3>().setConstant(
        options.translation_sigma_m * options.translation_sigma_m);
    prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
    scene.priors.push_back(prior);
  }
  return scene;
}

// RMSE of the camera centres against the truth after the best similarity
// (optionally its scale), and the largest rotation error.
struct PoseErrors {
  double rmse_m = 0.0;
  double scale = 1.0;
  double max_rotation_deg = 0.0;
};

inline PoseErrors ComparePoses(const SyntheticWorld& world,
                               const colmap::Reconstruction& reconstruction) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const SyntheticImage& image : world.images) {
    if (!reconstruction.IsImageRegistered(image.image_id)) continue;
    estimated.push_back(CamFromWorld(reconstruction.Image(image.image_id))
                            .TargetOriginInSource());
    truth.push_back(image.cam_from_world.TargetOriginInSource());
  }
  PoseErrors errors;
  Sim3d sim;
  if (!EstimateSim3d(estimated, truth, AlignmentOptions(), &sim)) {
    errors.rmse_m = std::numeric_limits<double>::infinity();
    return errors;
  }
  errors.scale = sim.scale;
  double sum = 0.0;
  for (size_t i = 0; i < truth.size(); ++i) {
    sum += (sim * estimated[i] - truth[i]).squaredNorm();
  }
  errors.rmse_m = std::sqrt(sum / truth.size());
  for (const SyntheticImage& image : world.images) {
    if (!reconstruction.IsImageRegistered(image.image_id)) continue;
    const Rigid3d aligned = TransformCamFromWorld(
        sim, CamFromWorld(reconstruction.Image(image.image_id)));
    errors.max_rotation_deg =
        std::max(errors.max_rotation_deg,
                 RadToDeg(AngleBetweenRad(aligned.rotation,
                                          image.cam_from_world.rotation)));
  }
  return errors;
}

}  // namespace adasfm
