// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/reprojection.h"

#include <limits>
#include <optional>

#include "colmap_ext/host/camera.h"

namespace adasfm {

double ComputeReprojectionError(const colmap::Reconstruction& reconstruction,
                                const colmap::Point3D& point) {
  double sum_px = 0.0;
  for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
    const colmap::Image& image = reconstruction.Image(element.image_id);
    const std::optional<Eigen::Vector2d> pixel =
        ProjectPoint(reconstruction.Camera(image.CameraId()),
                     CamFromWorld(image) * XyzOf(point));
    if (!pixel) return std::numeric_limits<double>::max();
    sum_px += (*pixel - XyOf(image.Point2D(element.point2D_idx))).norm();
  }
  return sum_px / TrackOf(point).Length();
}

}  // namespace adasfm
