// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/prior_support.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

// The indices of the violated priors; expects that all priors can be tested.
std::vector<size_t> FindViolated(const std::vector<RelativePosePrior>& priors,
                                 const colmap::Reconstruction& model) {
  std::vector<size_t> violated;
  for (size_t i = 0; i < priors.size(); ++i) {
    const std::optional<bool> is_violated = IsViolated(priors[i], model);
    EXPECT_TRUE(is_violated.has_value());
    if (is_violated.value_or(false)) violated.push_back(i);
  }
  return violated;
}

class IsViolatedTest : public testing::TestWithParam<uint64_t> {
 protected:
  IsViolatedTest() {
    BundleWorldOptions world;
    world.num_images = 120;
    world.seed = GetParam();
    model_ = BuildBundleWorld(world);
    Random random(GetParam());
    constexpr double kRotationSigma = 1e-3;
    constexpr double kTranslationSigma = 5e-3;
    for (const PosePriorEdge& edge : TruePriors(world)) {
      RelativePosePrior prior;
      prior.image_id1 = edge.image_id1;
      prior.image_id2 = edge.image_id2;
      prior.cam2_from_cam1 = edge.cam2_from_cam1;
      prior.cam2_from_cam1.rotation =
          ExpSo3(random.GaussianVector(kRotationSigma)) *
          prior.cam2_from_cam1.rotation;
      prior.cam2_from_cam1.translation +=
          random.GaussianVector(kTranslationSigma);
      prior.covariance.diagonal().head<3>().setConstant(
          std::pow(kRotationSigma, 2));
      prior.covariance.diagonal().tail<3>().setConstant(
          std::pow(kTranslationSigma, 2));
      prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
      priors_.push_back(prior);
    }
  }

  // Moves the images from the 60th on rigidly, as a false loop closure does.
  void MoveRest(const Rigid3d& world_from_moved) {
    for (const image_t image_id : model_.RegImageIds()) {
      if (image_id < kFirstMoved) continue;
      colmap::Image& image = model_.Image(image_id);
      SetCamFromWorld(CamFromWorld(image) * world_from_moved.Inverse(), &image);
    }
  }
  std::vector<size_t> PriorsAcross() const {
    std::vector<size_t> across;
    for (size_t i = 0; i < priors_.size(); ++i) {
      if (priors_[i].image_id1 < kFirstMoved &&
          priors_[i].image_id2 >= kFirstMoved) {
        across.push_back(i);
      }
    }
    return across;
  }

  static constexpr image_t kFirstMoved = 60;
  colmap::Reconstruction model_;
  std::vector<RelativePosePrior> priors_;
};

TEST_P(IsViolatedTest, ManySigmasOfAFewMillimetresAreNoTear) {
  EXPECT_TRUE(FindViolated(priors_, model_).empty());
  for (RelativePosePrior& prior : priors_) prior.covariance *= 1e-6;
  EXPECT_TRUE(FindViolated(priors_, model_).empty());
}

TEST_P(IsViolatedTest, AFoldTearsThePriorsThere) {
  MoveRest(Rigid3d(Eigen::Quaterniond::Identity(), {8.0, 0.0, -4.0}));
  EXPECT_EQ(FindViolated(priors_, model_), PriorsAcross());
}

// Priors of a gyroscope alone.
TEST_P(IsViolatedTest, AWrongTurnViolatesRotations) {
  for (RelativePosePrior& prior : priors_) {
    prior.flags = kPriorRotation;
  }
  MoveRest(Rigid3d(Eigen::Quaterniond::Identity(), {8.0, 0.0, -4.0}));
  EXPECT_TRUE(FindViolated(priors_, model_).empty());
  MoveRest(Rigid3d(ExpSo3({0.0, 0.3, 0.0}), Eigen::Vector3d::Zero()));
  EXPECT_EQ(FindViolated(priors_, model_), PriorsAcross());
}

TEST_P(IsViolatedTest, SlipsAndMissingImagesTellNothing) {
  RelativePosePrior prior = priors_[10];
  prior.flags |= kPriorWheelSlip;
  EXPECT_EQ(IsViolated(prior, model_), std::nullopt);
  prior = priors_[10];
  prior.flags = kPriorDirection;
  EXPECT_EQ(IsViolated(prior, model_), std::nullopt);
  prior = priors_[10];
  prior.image_id2 = 100000;
  EXPECT_EQ(IsViolated(prior, model_), std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Seeds, IsViolatedTest, testing::Values(1, 2, 3));

}  // namespace
}  // namespace adasfm
