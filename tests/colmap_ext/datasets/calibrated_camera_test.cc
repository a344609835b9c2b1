// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/calibrated_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class SensorsCameraTest : public testing::Test {
 protected:
  StatusOr<std::optional<CalibratedCamera>> TryRead(const std::string& text) {
    folder_.Write("sensors.yaml", text);
    return ReadSensorsCamera(folder_.File("sensors.yaml"));
  }
  std::optional<CalibratedCamera> Read(const std::string& text) {
    const auto camera = TryRead(text);
    EXPECT_TRUE(camera.ok()) << camera.status().message();
    return camera.ok() ? *camera : std::nullopt;
  }

  TemporaryFolder folder_;
};

TEST_F(SensorsCameraTest, PixelCentresAreCOLMAPs) {
  const auto camera = Read(
      "cam0:\n  intrinsics: [500, 501.5, 319.5, 239]\n"
      "  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
      "  resolution: [640, 480]\n");
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->model, "PINHOLE");
  EXPECT_EQ(camera->params, "500,501.5,320,239.5");
  EXPECT_EQ(camera->width_px, 640);
  EXPECT_EQ(camera->height_px, 480);
}

TEST_F(SensorsCameraTest, DistortionsGoToTheirModels) {
  auto camera = Read(
      "cam0: {camera_model: pinhole, intrinsics: [500, 500, 320, 240], "
      "distortion_model: radtan, distortion_coeffs: [0.25, -0.5, 0.125, 0]}");
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->model, "OPENCV");
  EXPECT_EQ(camera->params, "500,500,320.5,240.5,0.25,-0.5,0.125,0");
  EXPECT_EQ(camera->width_px, 0);
  camera = Read(
      "cam0: {intrinsics: [500, 500, 320, 240], distortion_model: equidistant, "
      "distortion_coeffs: [0.25, -0.5, 0.125, 0]}");
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->model, "OPENCV_FISHEYE");
  // OpenCV's own calibration has five coefficients.
  camera = Read(
      "cam0: {intrinsics: [500, 500, 320, 240], distortion_model: radtan, "
      "distortion_coeffs: [0.25, -0.5, 0.125, 0, 0.0625]}");
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->model, "FULL_OPENCV");
  EXPECT_EQ(camera->params,
            "500,500,320.5,240.5,0.25,-0.5,0.125,0,0.0625,0,0,0");
}

// Several cameras, no intrinsics, or no readable file: no camera.
TEST_F(SensorsCameraTest, WhatItDoesNotKnowIsLeftOut) {
  const std::string pinhole = "intrinsics: [500, 500, 320, 240]";
  EXPECT_TRUE(Read("cam0: {" + pinhole + "}").has_value());
  EXPECT_FALSE(Read("cam0: {" + pinhole + "}\ncam1: {" + pinhole + "}"));
  EXPECT_FALSE(Read("cam0: {timeshift_cam_imu: 0.0}"));
  EXPECT_FALSE(Read("cam0: ["));
  EXPECT_FALSE(*ReadSensorsCamera(folder_.File("none.yaml")));
}

// Unusable intrinsics are errors: a guessed focal length would silently spoil
// the model.
TEST_F(SensorsCameraTest, WhatIsWrongWithItIsSaid) {
  const std::string pinhole = "intrinsics: [500, 500, 320, 240]";
  const auto expect = [this](const std::string& cam0, const std::string& why) {
    const auto camera = TryRead("cam0: {" + cam0 + "}");
    ASSERT_FALSE(camera.ok()) << cam0;
    EXPECT_THAT(camera.status().message(), testing::HasSubstr(why));
    EXPECT_THAT(camera.status().message(), testing::HasSubstr("sensors.yaml"));
    EXPECT_THAT(camera.status().message(),
                testing::HasSubstr("--camera_params"));
  };
  expect("camera_model: omni, " + pinhole, "'omni'");
  expect(pinhole + ", distortion_model: fov, distortion_coeffs: [1]", "'fov'");
  expect(pinhole + ", distortion_coeffs: [1, 0, 0, 0]", "no model");
  expect(pinhole + ", distortion_model: radtan, distortion_coeffs: [1, 0]",
         "coefficients");
  expect(pinhole + ", distortion_model: radtan, distortion_coeffs: -0.2",
         "distortion_coeffs");
  expect(pinhole + ", resolution: [640]", "resolution");
  expect("intrinsics: [500, 320, 240]", "fu, fv, cu, cv");
  expect("intrinsics: [500, many, 320, 240]", "intrinsics");
  expect("intrinsics: [0, 0, 0, 0]", "uncalibrated");
}

}  // namespace
}  // namespace adasfm
