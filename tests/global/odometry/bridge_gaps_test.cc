// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/bridge_gaps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "core/random.h"
#include "core/sim3d.h"
#include "core/so3.h"
#include "tests/testing/global/inertial_walk.h"

namespace adasfm {
namespace {

constexpr int kNumSeeds = 20;
constexpr double kRotationSigma = 2e-4;
using Poses = std::map<image_t, Rigid3d>;

// A walk in which images first to last have no poses. The images behind the gap
// are a model in a frame and unit of its own.
struct WalkWithGap {
  WalkWithGap(uint64_t seed, image_t first, image_t last,
              int num_images = 240) {
    WalkOptions options;
    options.num_images = num_images;
    options.metres_per_unit = 1.0;
    walk = SimulateWalk(options, seed);
    Random random(seed + 50);
    for (RelativePosePrior& prior : walk.rotations) {
      prior.covariance.setZero();
      prior.covariance.diagonal().head<3>().setConstant(kRotationSigma *
                                                        kRotationSigma);
      prior.covariance.diagonal().tail<3>().setConstant(INFINITY);
      prior.cam2_from_cam1.rotation =
          ExpSo3(random.GaussianVector(kRotationSigma)) *
          prior.cam2_from_cam1.rotation;
    }
    models.resize(2);
    const Sim3d own_from_world(3.0, ExpSo3(random.GaussianVector(1.0)),
                               random.GaussianVector(10.0));
    for (const auto& [image_id, cam_from_world] : walk.cams_from_world) {
      if (image_id >= first && image_id <= last) continue;
      Rigid3d pose = cam_from_world;
      pose.translation += random.GaussianVector(0.005);
      if (image_id > last) pose = TransformCamFromWorld(own_from_world, pose);
      models[image_id > last][image_id] = pose;
    }
  }

  InertialOdometry Bridge() const {
    return BridgeGaps(walk.motions, walk.rotations, models);
  }

  Rigid3d TrueMotion(image_t image_id1, image_t image_id2) const {
    return walk.cams_from_world.at(image_id2) *
           walk.cams_from_world.at(image_id1).Inverse();
  }

  WalkData walk;
  std::vector<Poses> models;
};

const RelativePosePrior& PriorBehind(const InertialOdometry& odometry,
                                     image_t image_id) {
  return odometry.priors.at(image_id - 1);
}

// The error of the translation across the gap, in the axes of the image behind
// it, and its stated covariance.
struct GapError {
  Eigen::Vector3d error = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

GapError ErrorAcross(const WalkWithGap& walk, const InertialOdometry& odometry,
                     image_t before, image_t behind) {
  GapError sum;
  Rigid3d last_from_first;
  for (image_t image_id = before; image_id < behind; ++image_id) {
    const RelativePosePrior& prior = PriorBehind(odometry, image_id);
    EXPECT_TRUE(prior.HasMotion());
    last_from_first = prior.cam2_from_cam1 * last_from_first;
    const Eigen::Matrix3d turn =
        walk.TrueMotion(image_id + 1, behind).rotation.toRotationMatrix();
    sum.covariance +=
        turn * prior.covariance.bottomRightCorner<3, 3>() * turn.transpose();
  }
  sum.error =
      last_from_first.translation - walk.TrueMotion(before, behind).translation;
  return sum;
}

// Over kNumSeeds gaps of 1.5 s, the stated covariance must agree with the
// errors and be small enough to be useful. The smoother assumes more IMU noise
// than the simulation has.
void ExpectHonest(int num_images) {
  double chi2 = 0.0;
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const WalkWithGap walk(seed, 121, 134, num_images);
    const InertialOdometry odometry = walk.Bridge();
    ASSERT_EQ(odometry.num_gaps, 1) << "seed " << seed;
    EXPECT_EQ(odometry.bridges.size(), 15);
    const GapError sum = ErrorAcross(walk, odometry, 120, 135);
    EXPECT_LT(std::sqrt(sum.covariance.trace() / 3.0), 0.06);
    chi2 += sum.error.dot(sum.covariance.ldlt().solve(sum.error));
  }
  // Of the chi-square of 60 degrees of freedom, 0.1 % exceed 1.66 per degree.
  // Half of the assumed accelerometer noise alone gives 0.25.
  EXPECT_LT(chi2 / (3.0 * kNumSeeds), 1.66);
  EXPECT_GT(chi2 / (3.0 * kNumSeeds), 0.15);
}

TEST(BridgeGaps, TellsTheWayAcross) { ExpectHonest(240); }

// The accelerometer cannot determine the size of a model this short.
TEST(BridgeGaps, FindsTheSizeOfAShortModel) {
  ExpectHonest(165);
  for (uint64_t seed = 1; seed <= kNumSeeds; ++seed) {
    const WalkWithGap walk(seed, 121, 134, 165);
    const InertialOdometry odometry = walk.Bridge();
    double sum = 0.0, true_sum = 0.0;
    for (image_t image_id = 135; image_id < 165; ++image_id) {
      const RelativePosePrior& prior = PriorBehind(odometry, image_id);
      ASSERT_TRUE(prior.HasMotion());
      sum += prior.cam2_from_cam1.translation.norm();
      true_sum += walk.TrueMotion(image_id, image_id + 1).translation.norm();
    }
    EXPECT_NEAR(sum / true_sum, 1.0, 0.1) << "seed " << seed;
  }
}

TEST(BridgeGaps, StepsWithinModelsAreVisionsInMetres) {
  const WalkWithGap walk(1, 121, 134);
  const InertialOdometry odometry = walk.Bridge();
  for (const RelativePosePrior& prior : odometry.priors) {
    const ImagePair pair(prior.image_id1, prior.image_id2);
    if (odometry.bridges.count(pair) > 0) continue;
    ASSERT_TRUE(prior.HasMotion());
    const Eigen::Vector3d error =
        prior.cam2_from_cam1.translation -
        walk.TrueMotion(prior.image_id1, prior.image_id2).translation;
    const Eigen::Matrix3d covariance =
        prior.covariance.bottomRightCorner<3, 3>();
    // Of the chi-square of 3 degrees of freedom, 0.1 % exceed 16.3.
    EXPECT_LT(error.dot(covariance.ldlt().solve(error)), 16.3);
    EXPECT_EQ(prior.cam2_from_cam1.rotation.coeffs(),
              walk.walk.rotations[prior.image_id1 - 1]
                  .cam2_from_cam1.rotation.coeffs());
  }
}

// Two consecutive images without a common model, although each is in a model.
TEST(BridgeGaps, ParallelModelsMeetBetweenTwoImages) {
  const WalkWithGap walk(2, 121, 120);
  const InertialOdometry odometry = walk.Bridge();
  EXPECT_EQ(odometry.num_gaps, 1);
  ASSERT_EQ(odometry.bridges.size(), 1);
  EXPECT_TRUE(odometry.bridges.begin()->first == ImagePair(120, 121));
  EXPECT_LT(ErrorAcross(walk, odometry, 120, 121).error.norm(), 0.02);
}

TEST(BridgeGaps, WithoutGapsThereAreNoBridges) {
  WalkWithGap walk(3, 300, 300);
  const InertialOdometry odometry = walk.Bridge();
  EXPECT_EQ(odometry.num_gaps, 0);
  EXPECT_TRUE(odometry.bridges.empty());
}

TEST(BridgeGaps, LongGapsStayOpen) {
  const WalkWithGap walk(4, 121, 330, 450);  // 21 s
  const InertialOdometry odometry = walk.Bridge();
  EXPECT_EQ(odometry.num_gaps, 0);
  EXPECT_FALSE(PriorBehind(odometry, 200).HasLength());
}

TEST(BridgeGaps, NothingIsKnownWithoutMetres) {
  WalkWithGap walk(5, 121, 134);
  for (InertialMotion& motion : walk.walk.motions) {  // in g, not m/s^2
    motion.delta_velocity /= 9.81;
    motion.delta_position /= 9.81;
  }
  const InertialOdometry odometry = walk.Bridge();
  EXPECT_EQ(odometry.num_gaps, 0);
  for (const RelativePosePrior& prior : odometry.priors) {
    EXPECT_FALSE(prior.HasLength());
  }
}

}  // namespace
}  // namespace adasfm
