// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/camera.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace adasfm {
namespace {

// COLMAP inverts distortions by iteration. A pixel has a ray only when
// projecting the ray returns the pixel within this distance.
constexpr double kMaxRoundTripError_px = 0.05;

// Step of central differences of COLMAP's analytic projection: the errors of
// order step^2 and epsilon / step are both far below the accuracy of a pixel.
constexpr double kStep = 1e-5;

// d pixel / d (x/z, y/z).
Eigen::Matrix2d ComputeProjectionJacobian(const colmap::Camera& camera,
                                          const Eigen::Vector2d& normalized) {
  Eigen::Matrix2d jacobian;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(i);
    jacobian.col(i) = (PixelFromPlane(camera, normalized + step) -
                       PixelFromPlane(camera, normalized - step)) /
                      (2.0 * kStep);
  }
  return jacobian;
}

}  // namespace

bool HasUsableParams(const colmap::Camera& camera) {
  const std::vector<double>& params = ParamsOf(camera);
  const auto& focal = camera.FocalLengthIdxs();
  return std::all_of(params.begin(), params.end(),
                     [](double value) { return std::isfinite(value); }) &&
         std::all_of(focal.begin(), focal.end(),
                     [&params](size_t i) { return params[i] > 0.0; });
}

std::optional<Bearing> ComputeBearing(const colmap::Camera& camera,
                                      const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d normalized = PlaneFromPixel(camera, pixel);
  // Written so that NaN fails.
  if (!((PixelFromPlane(camera, normalized) - pixel).norm() <=
        kMaxRoundTripError_px)) {
    return std::nullopt;
  }
  const Eigen::Matrix2d projection =
      ComputeProjectionJacobian(camera, normalized);
  // Where the distortion is not monotonic, the projection reverses orientation.
  if (!(projection.determinant() > 0.0)) return std::nullopt;
  Bearing bearing;
  const double norm = normalized.homogeneous().norm();
  bearing.direction = normalized.homogeneous() / norm;
  const Eigen::Matrix3d tangent =
      (Eigen::Matrix3d::Identity() -
       bearing.direction * bearing.direction.transpose()) /
      norm;
  bearing.jacobian = tangent.leftCols<2>() * projection.inverse();
  return bearing;
}

std::vector<Bearing> ComputeBearings(
    const colmap::Camera& camera, const std::vector<Eigen::Vector2d>& pixels) {
  const Bearing none{Eigen::Vector3d::Zero(),
                     Eigen::Matrix<double, 3, 2>::Zero()};
  std::vector<Bearing> bearings;
  bearings.reserve(pixels.size());
  for (const Eigen::Vector2d& pixel : pixels) {
    bearings.push_back(ComputeBearing(camera, pixel).value_or(none));
  }
  return bearings;
}

std::optional<Eigen::Vector2d> ProjectPoint(
    const colmap::Camera& camera, const Eigen::Vector3d& point_in_cam) {
  if (!(point_in_cam.z() > 0.0)) return std::nullopt;
  return PixelFromPlane(camera, point_in_cam.hnormalized());
}

}  // namespace adasfm
