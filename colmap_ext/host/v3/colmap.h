// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/camera.h>
#include <base/camera_models.h>
#include <base/database.h>
#include <base/reconstruction.h>

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
  camera.SetCameraId(camera_id);
  camera.SetModelId(model_id);
  camera.SetWidth(width);
  camera.SetHeight(height);
  camera.SetParams(params);
  camera.SetPriorFocalLength(has_prior_focal_length);
  return camera;
}

inline int ModelIdOf(const colmap::Camera& camera) { return camera.ModelId(); }
inline double WidthOf(const colmap::Camera& camera) { return camera.Width(); }
inline double HeightOf(const colmap::Camera& camera) { return camera.Height(); }
inline bool HasPriorFocalLength(const colmap::Camera& camera) {
  return camera.HasPriorFocalLength();
}
inline const std::vector<double>& ParamsOf(const colmap::Camera& camera) {
  return camera.Params();
}
inline std::vector<double>& ParamsOf(colmap::Camera* camera) {
  return camera->Params();
}

inline Eigen::Vector2d PlaneFromPixel(const colmap::Camera& camera,
                                      const Eigen::Vector2d& pixel) {
  return camera.ImageToWorld(pixel);
}
inline Eigen::Vector2d PixelFromPlane(const colmap::Camera& camera,
                                      const Eigen::Vector2d& point) {
  return camera.WorldToImage(point);
}

inline const Eigen::Vector2d& XyOf(const colmap::Point2D& point) {
  return point.XY();
}
inline colmap::point3D_t PointIdOf(const colmap::Point2D& point) {
  return point.Point3DId();
}
inline const Eigen::Vector3d& XyzOf(const colmap::Point3D& point) {
  return point.XYZ();
}
inline void SetXyz(const Eigen::Vector3d& xyz, colmap::Point3D* point) {
  point->SetXYZ(xyz);
}
inline const colmap::Track& TrackOf(const colmap::Point3D& point) {
  return point.Track();
}
inline double ErrorOf(const colmap::Point3D& point) { return point.Error(); }
inline void SetError(double error_px, colmap::Point3D* point) {
  point->SetError(error_px);
}
inline Eigen::Matrix<uint8_t, 3, 1> ColorOf(const colmap::Point3D& point) {
  return point.Color();
}

// Convert between COLMAP's pose (w x y z, translation) and ours.
inline Rigid3d CamFromWorld(const colmap::Image& image) {
  const Eigen::Vector4d& qvec = image.Qvec();
  return Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)),
                 image.Tvec());
}
inline void SetCamFromWorld(const Rigid3d& cam_from_world,
                            colmap::Image* image) {
  const Eigen::Quaterniond& rotation = cam_from_world.rotation;
  image->SetQvec(
      Eigen::Vector4d(rotation.w(), rotation.x(), rotation.y(), rotation.z()));
  image->SetTvec(cam_from_world.translation);
}

inline bool IsRegistered(const colmap::Reconstruction& reconstruction,
                         image_t image_id) {
  return reconstruction.IsImageRegistered(image_id);
}
inline void AddCamera(const colmap::Camera& camera,
                      colmap::Reconstruction* reconstruction) {
  reconstruction->AddCamera(camera);
}
inline void AddRegisteredImage(colmap::Image image,
                               const Rigid3d& cam_from_world,
                               colmap::Reconstruction* reconstruction) {
  const image_t image_id = image.ImageId();
  SetCamFromWorld(cam_from_world, &image);
  reconstruction->AddImage(std::move(image));
  reconstruction->RegisterImage(image_id);
}

// Removes observations beyond the error, then points below the angle.
inline void FilterPoints(double max_reproj_error_px, double min_angle_deg,
                         colmap::Reconstruction* reconstruction) {
  reconstruction->FilterAllPoints3D(max_reproj_error_px, min_angle_deg);
}

// For a model that is not mapped further: frees what its images store about the
// positions of visible points, 22 kB per image.
inline void ReleaseVisibility(colmap::Reconstruction* reconstruction) {
  for (const auto& [image_id, image] : reconstruction->Images()) {
    reconstruction->Image(image_id).TearDown();
  }
}

}  // namespace adasfm
