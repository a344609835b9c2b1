// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/factor_plan.h"

#include <gtest/gtest.h>

#include <limits>

namespace adasfm {
namespace {

// A chain of motions of all images, as an IMU and wheels measure them.
std::vector<PosePriorEdge> ChainOf(const std::set<image_t>& images) {
  std::vector<PosePriorEdge> priors;
  for (const image_t image_id : images) {
    if (images.count(image_id + 1) == 0) continue;
    PosePriorEdge prior;
    prior.image_id1 = image_id;
    prior.image_id2 = image_id + 1;
    prior.rotation_sigma_rad = 1e-3;
    prior.length_sigma_m = 0.01;
    prior.dt_s = 0.2;
    priors.push_back(prior);
  }
  return priors;
}

class SensorsTieImagesTest : public testing::Test {
 protected:
  SensorsTieImagesTest() {
    for (image_t id = 1; id <= 300; ++id) images_.insert(id);
    priors_ = ChainOf(images_);
  }
  bool Tie() const { return DoSensorsTieImages(priors_, images_); }

  std::set<image_t> images_;
  std::vector<PosePriorEdge> priors_;
};

TEST_F(SensorsTieImagesTest, AllButOneInAHundred) {
  EXPECT_TRUE(Tie());
  // Each motion less unties one image at the end.
  priors_.resize(priors_.size() - 3);
  EXPECT_TRUE(Tie());
  priors_.pop_back();
  EXPECT_FALSE(Tie());
  priors_.clear();
  EXPECT_FALSE(Tie());
}

TEST_F(SensorsTieImagesTest, OnlyByMeasuredMotionsWithLengths) {
  const std::vector<PosePriorEdge> measured = priors_;
  for (PosePriorEdge& prior : priors_) prior.dt_s = -1.0;
  EXPECT_FALSE(Tie());
  priors_ = measured;
  for (PosePriorEdge& prior : priors_) prior.is_length_measured = false;
  EXPECT_FALSE(Tie());
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  priors_ = measured;
  for (PosePriorEdge& prior : priors_) prior.rotation_sigma_rad = kInfinity;
  EXPECT_FALSE(Tie());
  priors_ = measured;
  for (PosePriorEdge& prior : priors_) prior.length_sigma_m = kInfinity;
  EXPECT_FALSE(Tie());
  // Standing still has a translation in place of a length.
  for (PosePriorEdge& prior : priors_) prior.translation_sigma_m = 0.01;
  EXPECT_TRUE(Tie());
}

}  // namespace
}  // namespace adasfm
