// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <colmap/scene/camera.h>
#include <colmap/scene/reconstruction.h>
#include <colmap/sfm/observation_manager.h>

#include <limits>
#include <utility>
#include <vector>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

inline colmap::Camera MakeCamera(camera_t camera_id, int model_id, size_t width,
                                 size_t height,
                                 const std::vector<double>& params,
                                 bool has_prior_focal_length) {
  colmap::Camera camera;
  camera.camera_id = camera_id;
  camera.model_id = static_cast<colmap::CameraModelId>(model_id);
  camera.width = width;
  camera.height = height;
  camera.params = params;
  camera.has_prior_focal_length = has_prior_focal_length;
  return camera;
}

inline int ModelIdOf(const colmap::Camera& camera) {
  return static_cast<int>(camera.model_id);
}
inline double WidthOf(const colmap::Camera& camera) { return camera.width; }
inline double HeightOf(const colmap::Camera& camera) { return camera.height; }
inline bool HasPriorFocalLength(const colmap::Camera& camera) {
  return camera.has_prior_focal_length;
}
inline const std::vector<double>& ParamsOf(const colmap::Camera& camera) {
  return camera.params;
}
inline std::vector<double>& ParamsOf(colmap::Camera* camera) {
  return camera->params;
}

inline Eigen::Vector2d PlaneFromPixel(const colmap::Camera& camera,
                                      const Eigen::Vector2d& pixel) {
  return camera.CamFromImg(pixel).value_or(
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
}
inline Eigen::Vector2d PixelFromPlane(const colmap::Camera& camera,
                                      const Eigen::Vector2d& point) {
  return camera.ImgFromCam(point.homogeneous())
      .value_or(
          Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
}

inline const Eigen::Vector2d& XyOf(const colmap::Point2D& point) {
  return point.xy;
}
inline colmap::point3D_t PointIdOf(const colmap::Point2D& point) {
  return point.point3D_id;
}
inline const Eigen::Vector3d& XyzOf(const colmap::Point3D& point) {
  return point.xyz;
}
inline void SetXyz(const Eigen::Vector3d& xyz, colmap::Point3D* point) {
  point->xyz = xyz;
}
inline const colmap::Track& TrackOf(const colmap::Point3D& point) {
  return point.track;
}
inline double ErrorOf(const colmap::Point3D& point) { return point.error; }
inline void SetError(double error_px, colmap::Point3D* point) {
  point->error = error_px;
}
inline Eigen::Matrix<uint8_t, 3, 1> ColorOf(const colmap::Point3D& point) {
  return point.color;
}

// An image's pose is that of its frame. In the models made here, every image
// has its own frame and every camera its own rig, with the same ids; our own
// tables store rigs of several cameras (frames.h).
inline Rigid3d CamFromWorld(const colmap::Image& image) {
  const colmap::Rigid3d pose = image.CamFromWorld();
  return Rigid3d(Eigen::Quaterniond(pose.rotation()), pose.translation());
}
inline void SetCamFromWorld(const Rigid3d& cam_from_world,
                            colmap::Image* image) {
  image->FramePtr()->SetCamFromWorld(
      image->CameraId(),
      colmap::Rigid3d(cam_from_world.rotation, cam_from_world.translation));
}

inline bool IsRegistered(const colmap::Reconstruction& reconstruction,
                         image_t image_id) {
  return reconstruction.Image(image_id).HasPose();
}
inline void AddCamera(const colmap::Camera& camera,
                      colmap::Reconstruction* reconstruction) {
  reconstruction->AddCameraWithTrivialRig(camera);
}
inline void AddRegisteredImage(colmap::Image image,
                               const Rigid3d& cam_from_world,
                               colmap::Reconstruction* reconstruction) {
  reconstruction->AddImageWithTrivialFrame(
      std::move(image),
      colmap::Rigid3d(cam_from_world.rotation, cam_from_world.translation));
}

inline void FilterPoints(double max_reproj_error_px, double min_angle_deg,
                         colmap::Reconstruction* reconstruction) {
  colmap::ObservationManager(*reconstruction)
      .FilterAllPoints3D(max_reproj_error_px, min_angle_deg);
}

// Does nothing: not the model but its ObservationManager has this data.
inline void ReleaseVisibility(colmap::Reconstruction*) {}

}  // namespace adasfm
