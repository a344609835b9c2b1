// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/find_focal_length_error.h"

#include <gtest/gtest.h>

#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

// A street along which two cameras look up to 23 deg to both sides.
BundleWorldOptions TurningStreet(int num_images) {
  BundleWorldOptions world;
  world.num_images = num_images;
  world.num_keypoints_per_image = 40;
  world.weave_rad = 0.4;
  world.camera_params = {480, 480, 400, 250};
  world.pixel_noise_px = world.second_camera_noise_px = 0.5;
  return world;
}

// Reduces a point to two observations whose rays intersect behind the cameras.
void MatchWrongly(colmap::point3D_t id,
                  colmap::Reconstruction* reconstruction) {
  while (reconstruction->Point3D(id).Track().Length() > 2) {
    const colmap::TrackElement last =
        reconstruction->Point3D(id).Track().Elements().back();
    reconstruction->DeleteObservation(last.image_id, last.point2D_idx);
  }
  const std::vector<colmap::TrackElement> seen =
      reconstruction->Point3D(id).Track().Elements();
  colmap::Point2D& a =
      reconstruction->Image(seen[0].image_id).Point2D(seen[0].point2D_idx);
  colmap::Point2D& b =
      reconstruction->Image(seen[1].image_id).Point2D(seen[1].point2D_idx);
  const Eigen::Vector2d xy = a.XY();
  a.SetXY(b.XY());
  b.SetXY(xy);
}

// The error found if the focal length of camera 1 is `ratio` times too long and
// that of `constant_camera` is taken as correct.
std::optional<FocalLengthError> FindError(const BundleWorldOptions& world,
                                          double ratio, bool is_known,
                                          camera_t constant_camera,
                                          int num_wrong_points = 0) {
  colmap::Reconstruction reconstruction = BuildBundleWorld(world);
  for (int k = 1; k <= num_wrong_points; ++k) {
    MatchWrongly(k, &reconstruction);
  }
  for (const camera_t camera_id : {1, 2}) {
    reconstruction.Camera(camera_id).SetPriorFocalLength(camera_id == 1 &&
                                                         is_known);
  }
  for (const size_t i : {0, 1}) reconstruction.Camera(1).Params(i) *= ratio;
  PriorBundleAdjustmentProblem problem = ProblemOfAll(reconstruction);
  problem.priors = TruePriors(world);
  problem.constant_cameras = {constant_camera};
  return FindFocalLengthError(PriorBundleAdjustmentOptions(), problem,
                              reconstruction);
}

// Also if only some of the images are adjusted (300 of 320).
TEST(FindFocalLengthError, TakesConstantCamerasForRight) {
  for (const int num_images : {60, 320}) {
    const BundleWorldOptions world = TurningStreet(num_images);
    const auto error = FindError(world, 1.03, false, 2);
    ASSERT_TRUE(error.has_value()) << num_images;
    EXPECT_EQ(error->camera_id, 1);
    EXPECT_NEAR(error->ratio, 1.0 / 1.03, 4.0 * error->sigma);
    const auto beside = FindError(world, 1.03, false, 1);
    EXPECT_TRUE(!beside || beside->camera_id == 2) << num_images;
  }
}

// A measured focal length is contradicted by 10 sigmas, another one by 3,
// whatever the other camera is.
TEST(FindFocalLengthError, TrustsAMeasuredLensNextToAnUnknownOne) {
  BundleWorldOptions world = TurningStreet(40);
  world.num_keypoints_per_image = 20;
  // 0.5 % are 8 sigmas.
  EXPECT_TRUE(FindError(world, 1.005, false, 2).has_value());
  EXPECT_FALSE(FindError(world, 1.005, true, 2).has_value());
  EXPECT_TRUE(FindError(world, 1.01, true, 2).has_value());
}

// The cost of wrong points before they fall behind their cameras must not count
// as an error of the focal length.
TEST(FindFocalLengthError, ComparesTheSamePoints) {
  BundleWorldOptions world = TurningStreet(40);
  world.num_keypoints_per_image = 20;
  for (int num_wrong_points = 1; num_wrong_points <= 8; ++num_wrong_points) {
    EXPECT_FALSE(FindError(world, 1.005, true, 2, num_wrong_points).has_value())
        << num_wrong_points;
  }
}

}  // namespace
}  // namespace adasfm
