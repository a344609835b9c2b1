// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/existing_model.h"

#include <gtest/gtest.h>

#include <cmath>

#include "colmap_ext/scene/georeference.h"
#include "core/random.h"
#include "core/sim3d.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// A drive around a bend.
CoarsePoseMap TruePoses(int num_images, uint64_t seed) {
  Random random(seed);
  CoarsePoseMap poses;
  for (int i = 1; i <= num_images; ++i) {
    const Eigen::Vector3d center(20.0 * std::sin(0.05 * i),
                                 20.0 * std::cos(0.05 * i), 0.0);
    poses.emplace(
        i, CamFromWorldWithCenter(ExpSo3(random.GaussianVector(1.0)), center));
  }
  return poses;
}

CoarsePoseMap Without(image_t first, CoarsePoseMap poses) {
  poses.erase(poses.lower_bound(first), poses.end());
  return poses;
}

// A coarse model of the same shape in another frame and unit is moved onto the
// existing one exactly.
TEST(MoveToExistingModelTest, UndoesASimilarity) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const CoarsePoseMap truth = TruePoses(40, seed);
    const Sim3d other_from_world(random.Uniform(0.5, 2.0),
                                 ExpSo3(random.GaussianVector(1.0)),
                                 random.GaussianVector(10.0));
    const CoarsePosesAtExisting moved = MoveToExistingModel(
        Without(25, truth), TransformCamsFromWorld(other_from_world, truth));
    EXPECT_NEAR(moved.scale, 1.0 / other_from_world.scale, 1e-12);
    ASSERT_EQ(moved.poses.size(), truth.size());
    for (const auto& [image_id, pose] : truth) {
      const Rigid3d& found = moved.poses.at(image_id);
      EXPECT_LT(found.rotation.angularDistance(pose.rotation), 1e-7);
      EXPECT_LT((found.translation - pose.translation).norm(), 1e-10);
    }
  }
}

// A coarse model that bends away: existing images do not move at all, and the
// others keep their motion to the nearest of them.
TEST(MoveToExistingModelTest, NewImagesFollowTheNearestExistingOne) {
  const CoarsePoseMap truth = TruePoses(40, 1);
  const CoarsePoseMap existing = Without(25, truth);
  CoarsePoseMap coarse = truth;
  for (auto& [image_id, pose] : coarse) {
    pose = pose * Rigid3d(ExpSo3(Eigen::Vector3d(0.0, 0.0, 1e-3 * image_id)),
                          Eigen::Vector3d::Zero());
  }
  const CoarsePosesAtExisting moved = MoveToExistingModel(existing, coarse);
  for (const auto& [image_id, pose] : existing) {
    EXPECT_EQ(moved.poses.at(image_id).translation, pose.translation);
    EXPECT_EQ(moved.poses.at(image_id).rotation.coeffs(),
              pose.rotation.coeffs());
  }
  const image_t nearest = 24;
  for (image_t image_id = 25; image_id <= 40; ++image_id) {
    Rigid3d motion = coarse.at(image_id) * coarse.at(nearest).Inverse();
    motion.translation *= moved.scale;
    const Rigid3d expected = motion * existing.at(nearest);
    const Rigid3d& found = moved.poses.at(image_id);
    EXPECT_LT((found.translation - expected.translation).norm(), 1e-10);
  }
}

}  // namespace
}  // namespace adasfm
