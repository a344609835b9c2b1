// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "core/random.h"
#include "core/so3.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {
namespace {

SyntheticCamera MakeCamera(SyntheticCameraModel model) {
  SyntheticCamera camera;
  camera.model = model;
  if (model == SyntheticCameraModel::kFisheye) {
    camera.focal_px = 330.0;
    camera.fisheye_coeffs << -0.02, 0.004, -0.001, 0.0001;
  }
  return camera;
}

class CameraModel : public testing::TestWithParam<SyntheticCameraModel> {};

TEST_P(CameraModel, BearingInvertsProjection) {
  const SyntheticCamera camera = MakeCamera(GetParam());
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector2d pixel(random.Uniform(0.0, camera.width),
                                random.Uniform(0.0, camera.height));
    const Bearing bearing = ComputeBearing(camera, pixel);
    EXPECT_NEAR(bearing.direction.norm(), 1.0, 1e-12);
    Eigen::Vector2d projected;
    ASSERT_TRUE(ProjectPoint(
        camera, random.Uniform(0.5, 50.0) * bearing.direction, &projected));
    EXPECT_LT((projected - pixel).norm(), 1e-9);
  }
}

TEST_P(CameraModel, BearingJacobianMatchesNumericDerivative) {
  const SyntheticCamera camera = MakeCamera(GetParam());
  const Eigen::Vector2d principal(camera.principal_x_px, camera.principal_y_px);
  Random random(2);
  std::vector<Eigen::Vector2d> pixels = {
      principal, principal + Eigen::Vector2d(1e-5, -1e-5),
      principal + Eigen::Vector2d(0.01, 0.02)};
  for (int i = 0; i < 100; ++i) {
    pixels.emplace_back(random.Uniform(0.0, camera.width),
                        random.Uniform(0.0, camera.height));
  }
  const double step = 1e-3;
  for (const Eigen::Vector2d& pixel : pixels) {
    const Bearing bearing = ComputeBearing(camera, pixel);
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d delta = step * Eigen::Vector2d::Unit(k);
      const Eigen::Vector3d numeric =
          (ComputeBearing(camera, pixel + delta).direction -
           ComputeBearing(camera, pixel - delta).direction) /
          (2.0 * step);
      EXPECT_LT((numeric - bearing.jacobian.col(k)).norm(), 1e-10)
          << pixel.transpose();
    }
  }
}

TEST_P(CameraModel, RejectsPointsBehindTheCamera) {
  Eigen::Vector2d pixel;
  const SyntheticCamera camera = MakeCamera(GetParam());
  EXPECT_FALSE(ProjectPoint(camera, Eigen::Vector3d(0.1, 0.2, -1.0), &pixel));
  EXPECT_FALSE(ProjectPoint(camera, Eigen::Vector3d::Zero(), &pixel));
}

INSTANTIATE_TEST_SUITE_P(AllModels, CameraModel,
                         testing::Values(SyntheticCameraModel::kPinhole,
                                         SyntheticCameraModel::kFisheye));

TEST(FisheyeModel, ThrowsOutsideTheLens) {
  const SyntheticCamera camera = MakeCamera(SyntheticCameraModel::kFisheye);
  EXPECT_THROW(ComputeBearing(camera, Eigen::Vector2d(1e4, 1e4)),
               std::domain_error);
}

}  // namespace
}  // namespace adasfm
