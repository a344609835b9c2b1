// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/rotation_triples.h"

#include <gtest/gtest.h>

#include "core/so3.h"

namespace adasfm {
namespace {

TEST(RotationTriples, OnlyRightRotationsClose) {
  // Images 0 to 3 in order of time; rotation(2, 3) is wrong by 0.1 rad.
  std::vector<Eigen::Quaterniond> cams_from_world;
  for (int i = 0; i < 4; ++i) {
    cams_from_world.push_back(ExpSo3(Eigen::Vector3d(0.1, 0.5 * i, -0.2 * i)));
  }
  const auto rotation = [&](int i, int j) {
    TimedRotation entry;
    entry.start_ns = i;
    entry.end_ns = j;
    entry.cam2_from_cam1 = cams_from_world[j] * cams_from_world[i].conjugate();
    return entry;
  };
  std::vector<TimedRotation> rotations = {rotation(0, 1), rotation(1, 2),
                                          rotation(0, 2), rotation(2, 3),
                                          rotation(1, 3)};
  rotations[3].cam2_from_cam1 =
      ExpSo3(Eigen::Vector3d(0.0, 0.1, 0.0)) * rotations[3].cam2_from_cam1;
  const RotationTriples triples(rotations);
  for (const size_t k : {0, 1, 2}) {
    EXPECT_TRUE(triples.Closes(rotations[k], 1e-6)) << k;
  }
  EXPECT_FALSE(triples.Closes(rotations[3], 0.09));
  EXPECT_FALSE(triples.Closes(rotations[4], 0.09));
  EXPECT_TRUE(triples.Closes(rotations[3], 0.11));
}

TEST(RotationTriples, APairAloneDoesNotClose) {
  TimedRotation rotation;
  rotation.end_ns = 1;
  const std::vector<TimedRotation> rotations = {rotation};
  EXPECT_FALSE(RotationTriples(rotations).Closes(rotation, 1.0));
}

}  // namespace
}  // namespace adasfm
