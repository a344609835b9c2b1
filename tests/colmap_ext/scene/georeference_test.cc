// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/georeference.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

RelativePosePrior LengthBetween(image_t image_id1, image_t image_id2) {
  RelativePosePrior prior;
  prior.image_id1 = image_id1;
  prior.image_id2 = image_id2;
  prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
  return prior;
}

TEST(HasMetricPriors, SensorsOrARigOfTheModelsImagesTellTheMetre) {
  const std::map<image_t, Rigid3d> poses = {{1, Rigid3d()}, {2, Rigid3d()}};
  SceneData scene;
  EXPECT_FALSE(HasMetricPriors(scene, poses));
  scene.priors = {LengthBetween(2, 3)};
  scene.frame_priors = {LengthBetween(3, 4)};
  EXPECT_FALSE(HasMetricPriors(scene, poses));
  scene.priors = {LengthBetween(1, 2)};
  EXPECT_TRUE(HasMetricPriors(scene, poses));
  scene.priors.clear();
  scene.frame_priors = {LengthBetween(1, 2)};
  EXPECT_TRUE(HasMetricPriors(scene, poses));
}

}  // namespace
}  // namespace adasfm
