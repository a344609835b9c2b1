// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/camera.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {
namespace {

colmap::Camera MakeCamera(const std::string& model,
                          const std::vector<double>& params) {
  colmap::Camera camera;
  camera.SetModelIdFromName(model);
  camera.SetWidth(800);
  camera.SetHeight(500);
  camera.SetParams(params);
  return camera;
}

std::vector<colmap::Camera> MakeCameras() {
  return {MakeCamera("SIMPLE_PINHOLE", {480, 400, 250}),
          MakeCamera("PINHOLE", {480, 500, 390, 260}),
          MakeCamera("SIMPLE_RADIAL", {480, 400, 250, -0.05}),
          MakeCamera("OPENCV", {480, 485, 400, 250, -0.1, 0.02, 1e-3, -1e-3}),
          MakeCamera("OPENCV_FISHEYE",
                     {300, 300, 400, 250, 0.02, -0.01, 0.003, -5e-4})};
}

TEST(ComputeBearing, InvertsTheProjectionAndItsDerivative) {
  Random random(1);
  for (const colmap::Camera& camera : MakeCameras()) {
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector2d pixel(random.Uniform(5, 795),
                                  random.Uniform(5, 495));
      const std::optional<Bearing> bearing = ComputeBearing(camera, pixel);
      ASSERT_TRUE(bearing.has_value()) << camera.ModelName();
      EXPECT_NEAR(bearing->direction.norm(), 1.0, 1e-12);
      const double depth = random.Uniform(0.5, 50.0);
      const std::optional<Eigen::Vector2d> projected =
          ProjectPoint(camera, depth * bearing->direction);
      ASSERT_TRUE(projected.has_value());
      // COLMAP's inversion stops at steps of 1e-5 focal lengths.
      EXPECT_LT((*projected - pixel).norm(), 2e-2);
      // The Jacobian predicts the bearing of a pixel nearby. The error is of
      // second order, below (1 / f)^2 for one pixel.
      const Eigen::Vector2d step(random.Gaussian(0.5), random.Gaussian(0.5));
      const std::optional<Bearing> moved = ComputeBearing(camera, pixel + step);
      ASSERT_TRUE(moved.has_value());
      EXPECT_LT(
          (moved->direction - bearing->direction - bearing->jacobian * step)
              .norm(),
          5e-5);
    }
  }
}

TEST(ComputeBearing, AgreesWithTheSyntheticFisheye) {
  SyntheticCamera synthetic;
  synthetic.model = SyntheticCameraModel::kFisheye;
  synthetic.focal_px = 300.0;
  synthetic.fisheye_coeffs = Eigen::Vector4d(0.02, -0.01, 0.003, -5e-4);
  const colmap::Camera camera = MakeCameras().back();
  Random random(2);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d pixel(random.Uniform(5, 795), random.Uniform(5, 495));
    const Bearing expected = ComputeBearing(synthetic, pixel);
    const std::optional<Bearing> bearing = ComputeBearing(camera, pixel);
    ASSERT_TRUE(bearing.has_value());
    EXPECT_LT((bearing->direction - expected.direction).norm(), 1e-4);
    EXPECT_LT((bearing->jacobian - expected.jacobian).norm(),
              1e-2 * expected.jacobian.norm());
  }
}

TEST(ComputeBearing, BeyondTheModelThereIsNone) {
  // 90 degrees from the axis lie 471 px from the centre.
  const colmap::Camera fisheye =
      MakeCamera("OPENCV_FISHEYE", {300, 300, 400, 250, 0, 0, 0, 0});
  EXPECT_TRUE(ComputeBearing(fisheye, {800, 250}).has_value());
  EXPECT_FALSE(ComputeBearing(fisheye, {1000, 250}).has_value());
  const std::vector<Bearing> bearings =
      ComputeBearings(fisheye, {{400, 250}, {1000, 250}});
  ASSERT_EQ(bearings.size(), 2);
  EXPECT_NEAR(bearings[0].direction.z(), 1.0, 1e-9);
  EXPECT_TRUE(bearings[1].direction.isZero());
  EXPECT_FALSE(ProjectPoint(fisheye, {1, 0, 0}).has_value());
  EXPECT_FALSE(ProjectPoint(fisheye, {0, 0, -1}).has_value());
}

}  // namespace
}  // namespace adasfm
