// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/pose_prior_edge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace adasfm {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(PosePriorEdgeFromPriorTest, TakesWhatTheFlagsClaim) {
  RelativePosePrior prior;
  prior.image_id1 = 1;
  prior.image_id2 = 2;
  prior.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, -2.0);
  prior.covariance.setZero();
  prior.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 0.01, 0.01, 0.0025;
  prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
  const PosePriorEdge edge = PosePriorEdgeFromPrior(prior);
  EXPECT_NEAR(edge.rotation_sigma_rad, 0.01, 1e-12);
  EXPECT_NEAR(edge.direction_sigma_rad, 0.05, 1e-12);
  EXPECT_NEAR(edge.length_sigma_m, 0.05, 1e-12);

  EXPECT_EQ(edge.translation_sigma_m, kInfinity);

  // A standstill.
  RelativePosePrior standstill = prior;
  standstill.cam2_from_cam1.translation /= 20.0;
  const PosePriorEdge short_edge = PosePriorEdgeFromPrior(standstill);
  EXPECT_EQ(short_edge.direction_sigma_rad, kInfinity);
  EXPECT_EQ(short_edge.length_sigma_m, kInfinity);
  EXPECT_NEAR(short_edge.translation_sigma_m, std::sqrt(0.0225 / 3.0), 1e-12);
  standstill.cam2_from_cam1.translation.setZero();
  EXPECT_NEAR(PosePriorEdgeFromPrior(standstill).translation_sigma_m,
              std::sqrt(0.0225 / 3.0), 1e-12);

  prior.flags = kPriorRotation;
  const PosePriorEdge rotation_only = PosePriorEdgeFromPrior(prior);
  EXPECT_EQ(rotation_only.direction_sigma_rad, kInfinity);
  EXPECT_EQ(rotation_only.length_sigma_m, kInfinity);
}

// A window of a shared error ends with its time span or with the chain of
// motions.
TEST(AssignSharedErrorWindowsTest, AWindowEndsWithItsSpanOrTheChain) {
  std::vector<PosePriorEdge> edges;
  for (image_t id = 1; id <= 12; ++id) {
    if (id == 9) continue;
    PosePriorEdge& edge = edges.emplace_back();
    edge.image_id1 = id;
    edge.image_id2 = id + 1;
    edge.dt_s = 1.0;
  }
  // An edge that no sensor measured.
  PosePriorEdge& coarse = edges.emplace_back();
  coarse.image_id1 = 3;
  coarse.image_id2 = 9;
  SharedErrorOptions options;
  options.gyroscope_window_s = 3.5;
  AssignSharedErrorWindows(options, &edges);
  std::vector<int> gyroscope;
  std::vector<int> direction;
  for (const PosePriorEdge& edge : edges) {
    gyroscope.push_back(edge.windows.gyroscope);
    direction.push_back(edge.windows.direction);
  }
  EXPECT_EQ(gyroscope, (std::vector<int>{0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 0}));
  EXPECT_EQ(direction, (std::vector<int>{0, 0, 0, 1, 1, 1, 2, 2, 3, 3, 3, 0}));
}

}  // namespace
}  // namespace adasfm
