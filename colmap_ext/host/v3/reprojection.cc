// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/reprojection.h"

#include <base/projection.h>

#include <cmath>

namespace adasfm {

double ComputeReprojectionError(const colmap::Reconstruction& reconstruction,
                                const colmap::Point3D& point) {
  double sum_px = 0.0;
  for (const colmap::TrackElement& element : point.Track().Elements()) {
    const colmap::Image& image = reconstruction.Image(element.image_id);
    sum_px += std::sqrt(colmap::CalculateSquaredReprojectionError(
        image.Point2D(element.point2D_idx).XY(), point.XYZ(), image.Qvec(),
        image.Tvec(), reconstruction.Camera(image.CameraId())));
  }
  return sum_px / point.Track().Length();
}

}  // namespace adasfm
