// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <stdexcept>

#include "core/so3.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {
namespace {

// Beyond this the fisheye model is not used: a lens sees little there, and
// COLMAP's model has no rays at a right angle.
constexpr double kMaxFisheyeAngle = DegToRad(85.0);

struct DistortedAngle {
  double value;
  double derivative;
};

// theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
DistortedAngle DistortAngle(const Eigen::Vector4d& k, double theta) {
  const double t = theta * theta;
  return {theta * (1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3])))),
          1.0 + t * (3.0 * k[0] +
                     t * (5.0 * k[1] + t * (7.0 * k[2] + t * 9.0 * k[3])))};
}

double UndistortAngle(const Eigen::Vector4d& k, double theta_d) {
  double theta = theta_d;
  for (int i = 0; i < 50; ++i) {
    const DistortedAngle d = DistortAngle(k, theta);
    const double step = (d.value - theta_d) / d.derivative;
    theta -= step;
    if (!(theta >= 0.0 && theta <= kPi)) break;
    if (std::abs(step) < 1e-14) return theta;
  }
  throw std::domain_error("ComputeBearing: the pixel lies outside the lens");
}

}  // namespace

SyntheticCamera CameraOfImage(const SyntheticCamera& camera,
                              const SyntheticImage& image) {
  SyntheticCamera its_camera = camera;
  its_camera.focal_px *= image.focal_factor;
  return its_camera;
}

Bearing ComputeBearing(const SyntheticCamera& camera,
                       const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d m =
      (pixel - Eigen::Vector2d(camera.principal_x_px, camera.principal_y_px)) /
      camera.focal_px;
  Bearing bearing;
  if (camera.model == SyntheticCameraModel::kPinhole) {
    const Eigen::Vector3d ray(m.x(), m.y(), 1.0);
    bearing.direction = ray.normalized();
    const Eigen::Matrix3d projection =
        (Eigen::Matrix3d::Identity() -
         bearing.direction * bearing.direction.transpose()) /
        ray.norm();
    bearing.jacobian = projection.leftCols<2>() / camera.focal_px;
    return bearing;
  }
  const double r = m.norm();
  const double theta = UndistortAngle(camera.fisheye_coeffs, r);
  const double dtheta =
      1.0 / DistortAngle(camera.fisheye_coeffs, theta).derivative;
  // direction = (a m, cos theta) with a = sin theta / r; 1 on the axis.
  const double a = r > 1e-6 ? std::sin(theta) / r : 1.0;
  const double da_over_r =
      r > 1e-4 ? (std::cos(theta) * dtheta - a) / (r * r) : 0.0;
  const double sin_over_r_dtheta = a * dtheta;
  bearing.direction << a * m, std::cos(theta);
  bearing.jacobian.topRows<2>() =
      a * Eigen::Matrix2d::Identity() + da_over_r * m * m.transpose();
  bearing.jacobian.row(2) = -sin_over_r_dtheta * m.transpose();
  bearing.jacobian /= camera.focal_px;
  return bearing;
}

bool ProjectPoint(const SyntheticCamera& camera,
                  const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel) {
  const Eigen::Vector2d principal(camera.principal_x_px, camera.principal_y_px);
  if (camera.model == SyntheticCameraModel::kPinhole) {
    if (point_in_cam.z() < 1e-6) return false;
    *pixel =
        principal + camera.focal_px * point_in_cam.head<2>() / point_in_cam.z();
    return true;
  }
  const double radius = point_in_cam.head<2>().norm();
  const double theta = std::atan2(radius, point_in_cam.z());
  if (point_in_cam.norm() < 1e-9 || theta > kMaxFisheyeAngle) return false;
  const double theta_d = DistortAngle(camera.fisheye_coeffs, theta).value;
  const double factor = radius > 1e-12 ? theta_d / radius : 0.0;
  *pixel = principal + camera.focal_px * factor * point_in_cam.head<2>();
  return true;
}

std::vector<Bearing> ComputeBearings(const SyntheticCamera& camera,
                                     const SyntheticImage& image) {
  std::vector<Bearing> bearings;
  bearings.reserve(image.keypoints.size());
  for (const Eigen::Vector2d& keypoint : image.keypoints) {
    bearings.push_back(ComputeBearing(camera, keypoint));
  }
  return bearings;
}

}  // namespace adasfm
