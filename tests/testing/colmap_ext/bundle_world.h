// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <set>
#include <string>
#include <unordered_set>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/random.h"
#include "core/so3.h"

namespace adasfm {

// A street driven forwards, as a reconstruction: images 1, 2, ... look along
// +x of a z-up world and weave a little; points lie on both facades, each seen
// over some metres.
struct BundleWorldOptions {
  int num_images = 20;
  int num_keypoints_per_image = 100;
  double spacing_m = 1.5;
  double pixel_noise_px = 0.0;
  // COLMAP's name and parameters of the camera.
  std::string camera_model = "PINHOLE";
  std::vector<double> camera_params = {480, 485, 400, 250};
  // Largest yaw of the camera to the left and to the right of the street.
  double weave_rad = 0.15;
  // When positive, every other image is of camera 2, whose keypoints have this
  // noise. Two fifths of the points are seen by camera 1 only, two fifths by
  // camera 2 only, as with lenses that look to different sides.
  double second_camera_noise_px = 0.0;
  uint64_t seed = 1;
};

inline Rigid3d BundleWorldPose(const BundleWorldOptions& options, int index) {
  const double x = options.spacing_m * index;
  const double yaw = options.weave_rad * std::sin(0.08 * x);
  Eigen::Matrix3d cam_from_body;  // body: x forward, y left, z up
  cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Eigen::Quaterniond body_from_world(
      Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()));
  const Eigen::Vector3d center(x, 2.0 * std::sin(0.05 * x),
                               1.5 + 0.1 * std::sin(0.3 * x));
  return CamFromWorldWithCenter(
      Eigen::Quaterniond(cam_from_body) * body_from_world, center);
}

inline colmap::Reconstruction BuildBundleWorld(
    const BundleWorldOptions& options) {
  constexpr double kSeenOver_m = 12.0;
  Random random(options.seed);
  colmap::Reconstruction reconstruction;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.SetModelIdFromName(options.camera_model);
  camera.SetWidth(800);
  camera.SetHeight(500);
  camera.SetParams(options.camera_params);
  reconstruction.AddCamera(camera);
  const bool has_second_camera = options.second_camera_noise_px > 0.0;
  if (has_second_camera) {
    camera.SetCameraId(2);
    reconstruction.AddCamera(camera);
  }
  const auto is_second = [&](int i) { return has_second_camera && i % 2; };

  const int num_points =
      static_cast<int>(options.num_images * options.num_keypoints_per_image *
                       options.spacing_m / kSeenOver_m);
  std::vector<Rigid3d> poses;
  for (int i = 0; i < options.num_images; ++i) {
    poses.push_back(BundleWorldPose(options, i));
  }
  std::vector<std::vector<Eigen::Vector2d>> keypoints(options.num_images);
  std::vector<colmap::Track> tracks;
  std::vector<Eigen::Vector3d> points;
  const double length = options.num_images * options.spacing_m;
  for (int p = 0; p < num_points; ++p) {
    const double side = random.Uniform(-1.0, 1.0) < 0.0 ? -1.0 : 1.0;
    const Eigen::Vector3d point(random.Uniform(12.0, length + 24.0),
                                side * random.Uniform(8.0, 12.0),
                                random.Uniform(0.0, 8.0));
    const double nearest = random.Uniform(12.0, 24.0);
    const double share = has_second_camera ? random.Uniform(0.0, 1.0) : 1.0;
    colmap::Track track;
    for (int i = 0; i < options.num_images; ++i) {
      if (share < 0.8 && is_second(i) != (share < 0.4)) continue;
      const Eigen::Vector3d x_in_cam = poses[i] * point;
      if (x_in_cam.z() < nearest || x_in_cam.z() > nearest + kSeenOver_m) {
        continue;
      }
      const Eigen::Vector2d pixel = camera.WorldToImage(x_in_cam.hnormalized());
      if (pixel.minCoeff() < 0 || pixel.x() > 800 || pixel.y() > 500) continue;
      track.AddElement(i + 1, keypoints[i].size());
      const double noise_px = is_second(i) ? options.second_camera_noise_px
                                           : options.pixel_noise_px;
      keypoints[i].push_back(pixel +
                             Eigen::Vector2d(random.Gaussian(noise_px),
                                             random.Gaussian(noise_px)));
    }
    if (track.Length() < 2) continue;
    tracks.push_back(track);
    points.push_back(point);
  }
  for (int i = 0; i < options.num_images; ++i) {
    colmap::Image image;
    image.SetImageId(i + 1);
    image.SetName("image" + std::to_string(i + 1));
    image.SetCameraId(is_second(i) ? 2 : 1);
    image.SetPoints2D(keypoints[i]);
    SetCamFromWorld(poses[i], &image);
    reconstruction.AddImage(image);
    reconstruction.RegisterImage(i + 1);
  }
  for (size_t p = 0; p < points.size(); ++p) {
    reconstruction.AddPoint3D(points[p], tracks[p]);
  }
  return reconstruction;
}

// Moves every pose but that of image 1, and every point, by normal errors.
inline void PerturbBundleWorld(double rotation_sigma_rad, double sigma_m,
                               uint64_t seed,
                               colmap::Reconstruction* reconstruction) {
  Random random(seed);
  for (const image_t image_id : reconstruction->RegImageIds()) {
    if (image_id == 1) continue;
    colmap::Image& image = reconstruction->Image(image_id);
    const Rigid3d pose = CamFromWorld(image);
    SetCamFromWorld(
        CamFromWorldWithCenter(
            ExpSo3(random.GaussianVector(rotation_sigma_rad)) * pose.rotation,
            pose.TargetOriginInSource() + random.GaussianVector(sigma_m)),
        &image);
  }
  const std::unordered_set<colmap::point3D_t> ids =
      reconstruction->Point3DIds();
  for (const colmap::point3D_t id :
       std::set<colmap::point3D_t>(ids.begin(), ids.end())) {
    reconstruction->Point3D(id).XYZ() += random.GaussianVector(sigma_m);
  }
}

}  // namespace adasfm
