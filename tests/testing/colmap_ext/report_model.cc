// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/colmap_ext/report_model.h"

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {

colmap::Reconstruction MakeModel(const SyntheticWorld& world, int num_points,
                                 double shift_px) {
  colmap::Reconstruction model;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.InitializeWithName("SIMPLE_PINHOLE", 500.0, 800, 500);
  model.AddCamera(camera);
  for (const SyntheticImage& entry : world.images) {
    colmap::Image image;
    image.SetImageId(entry.image_id);
    image.SetCameraId(1);
    image.SetName(entry.name);
    SetCamFromWorld(entry.cam_from_world, &image);
    // Points lie on the axis, 10 m ahead.
    image.SetPoints2D(std::vector<Eigen::Vector2d>(
        num_points, Eigen::Vector2d(400.0 + shift_px, 250.0)));
    model.AddImage(image);
    model.RegisterImage(entry.image_id);
  }
  for (const SyntheticImage& entry : world.images) {
    for (int k = 0; k < num_points; ++k) {
      colmap::Track track;
      track.AddElement(entry.image_id, k);
      model.AddPoint3D(
          entry.cam_from_world.Inverse() * Eigen::Vector3d(0.0, 0.0, 10.0),
          track, Eigen::Vector3ub(1, 2, 3));
    }
  }
  return model;
}

}  // namespace adasfm
