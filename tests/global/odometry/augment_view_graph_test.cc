// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/augment_view_graph.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// One metre ahead.
RelativePosePrior Step(double seconds, double rotation_sigma_deg,
                       double translation_sigma_m) {
  RelativePosePrior prior;
  prior.image_id1 = 1;
  prior.image_id2 = 2;
  prior.dt_ns = static_cast<timestamp_t>(1e9 * seconds);
  prior.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, -1.0);
  const double rotation_sigma_rad = DegToRad(rotation_sigma_deg);
  prior.covariance.setZero();
  prior.covariance.diagonal()
      << Eigen::Vector3d::Constant(rotation_sigma_rad * rotation_sigma_rad),
      Eigen::Vector3d::Constant(translation_sigma_m * translation_sigma_m);
  prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
  return prior;
}

int NumAdded(const RelativePosePrior& prior) {
  ViewGraph graph;
  graph.images = {1, 2};
  return AddSensorEdges(AugmentationOptions(), {prior}, &graph);
}

TEST(AddSensorEdges, TakesLongPriorsThatErrLittle) {
  // Short priors whatever their error: their weight accounts for the error.
  EXPECT_EQ(NumAdded(Step(0.4, 0.1, 0.01)), 1);
  EXPECT_EQ(NumAdded(Step(0.4, 3.0, 0.3)), 1);
  // A photo every second.
  EXPECT_EQ(NumAdded(Step(1.0, 0.1, 0.01)), 1);
  EXPECT_EQ(NumAdded(Step(1.0, 3.0, 0.01)), 0);
  EXPECT_EQ(NumAdded(Step(1.0, 0.1, 0.3)), 0);
  // The error of a translation counts relative to its length.
  RelativePosePrior far = Step(1.0, 0.1, 0.3);
  far.cam2_from_cam1.translation *= 20.0;
  EXPECT_EQ(NumAdded(far), 1);
}

TEST(AddSensorEdges, TakesLongRotationsWithoutPosition) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  RelativePosePrior prior = Step(2.0, 0.2, kInfinity);
  prior.flags = kPriorRotation;
  EXPECT_EQ(NumAdded(prior), 1);
  prior = Step(2.0, 2.0, kInfinity);
  prior.flags = kPriorRotation;
  EXPECT_EQ(NumAdded(prior), 0);
}

}  // namespace
}  // namespace adasfm
