// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/overlap_predictor.h"

#include <gtest/gtest.h>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

// Images whose motion is set by each test.
class OverlapPredictorTest : public testing::Test {
 protected:
  OverlapPredictorTest() {
    SyntheticWorldOptions options;
    options.num_images = 12;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world, path_).ok());
  }

  // The overlap of two images with this motion between them.
  std::optional<double> Predict(const Rigid3d& cam2_from_cam1,
                                double sigma = 0.001,
                                uint32_t flags = kPriorRotation |
                                                 kPriorDirection |
                                                 kPriorLength) {
    RelativePosePrior prior;
    prior.image_id1 = 1;
    prior.image_id2 = 2;
    prior.cam2_from_cam1 = cam2_from_cam1;
    prior.covariance *= sigma * sigma;
    prior.flags = flags;
    PriorTables tables;
    tables.priors = {prior};
    tables.image_times = {{1, 0}, {2, 100000000}};
    EXPECT_TRUE(WritePriorTables(path_, tables).ok());
    const StatusOr<OverlapPredictor> predictor =
        OverlapPredictor::Read(options_, path_);
    EXPECT_TRUE(predictor.ok());
    return predictor->Predict(ImagePair(1, 2));
  }

  static Rigid3d Move(double right_m, double forward_m, double turn_deg) {
    const Rigid3d turn(ExpSo3(Eigen::Vector3d(0, turn_deg / 180.0 * M_PI, 0)),
                       Eigen::Vector3d::Zero());
    return turn * Rigid3d(Eigen::Quaterniond::Identity(),
                          Eigen::Vector3d(-right_m, 0, -forward_m));
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.File("database.db");
  OverlapPredictionOptions options_;
};

TEST_F(OverlapPredictorTest, FallsWithDistanceAndTurn) {
  EXPECT_EQ(Predict(Move(0, 0, 0)), 1.0);
  for (const auto& step : {Move(0, 8, 0), Move(5, 0, 0), Move(0, 0, 15)}) {
    const double near = Predict(step).value();
    EXPECT_GT(near, 0.3);
    EXPECT_LT(near, 0.95);
    EXPECT_LT(Predict(step * step).value(), near);
    // The overlap is symmetric.
    EXPECT_NEAR(Predict(step.Inverse()).value(), near, 1e-9);
  }
  EXPECT_EQ(Predict(Move(0, 0, 180)), 0.0);
  EXPECT_EQ(Predict(Move(0, 60, 0)), 0.0);
  EXPECT_EQ(Predict(Move(60, 0, 0)), 0.0);
  // Images further apart overlap if the scene is deeper.
  const double shallow = Predict(Move(0, 30, 0)).value();
  options_.scene_depth_m = 60.0;
  EXPECT_GT(Predict(Move(0, 30, 0)).value(), 2.0 * shallow);
}

TEST_F(OverlapPredictorTest, SaysNothingWhereTheOdometryIsNotSure) {
  EXPECT_FALSE(Predict(Move(0, 8, 0), 3.0).has_value());
  EXPECT_FALSE(Predict(Move(0, 60, 0), 5.0).has_value());
  // So far apart that the uncertainty does not matter.
  EXPECT_EQ(Predict(Move(0, 600, 0), 5.0), 0.0);
  // Rotation alone only excludes the overlap of images that look elsewhere.
  EXPECT_FALSE(Predict(Move(0, 8, 0), 0.001, kPriorRotation).has_value());
  EXPECT_EQ(Predict(Move(0, 8, 180), 0.001, kPriorRotation), 0.0);
  EXPECT_FALSE(Predict(Move(0, 8, 180), 3.0, kPriorRotation).has_value());
  options_.enabled = false;
  EXPECT_FALSE(Predict(Move(0, 8, 0)).has_value());
}

TEST_F(OverlapPredictorTest, OptionsAreChecked) {
  std::string error;
  EXPECT_TRUE(options_.IsValid(&error));
  options_.scene_depth_m = 0.0;
  EXPECT_FALSE(options_.IsValid(&error));
  EXPECT_NE(error.find("scene_depth_m"), std::string::npos);
  options_ = OverlapPredictionOptions();
  options_.min_overlap = 1.5;
  EXPECT_FALSE(options_.IsValid(&error));
  EXPECT_NE(error.find("min_overlap"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
