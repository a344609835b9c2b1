// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "core/rigid3d.h"
#include "core/sim3d.h"
#include "core/types.h"

namespace adasfm {

// EXPECT_TRUE(RotationsNear(a, b, tolerance_rad)).
testing::AssertionResult RotationsNear(const Eigen::Quaterniond& a,
                                       const Eigen::Quaterniond& b,
                                       double tolerance_rad);

// EXPECT_TRUE(PosesNear(a, b, tolerance_rad, tolerance_m)); the positions are
// compared at the camera centres.
testing::AssertionResult PosesNear(const Rigid3d& a_from_world,
                                   const Rigid3d& b_from_world,
                                   double tolerance_rad, double tolerance_m);

// Errors of an estimate against the truth after the best similarity (or rigid
// alignment) between the camera centres; images of both only.
struct AlignedErrors {
  int num_images = 0;
  double rmse_m = 0.0;
  double max_m = 0.0;
  double mean_rotation_rad = 0.0;
  // The similarity's scale; 1 when not estimated.
  double scale = 1.0;
};
AlignedErrors ComputeAlignedErrors(
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, Rigid3d>& true_cams_from_world,
    const AlignmentOptions& options);

// Rotations only: the mean angle after the best common rotation of the world.
double ComputeAlignedRotationError(
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Quaterniond>& true_cams_from_world);

}  // namespace adasfm
