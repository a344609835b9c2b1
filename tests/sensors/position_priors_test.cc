// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/position_priors.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace adasfm {
namespace {

constexpr int64_t kSecondNs = 1'000'000'000;
constexpr timestamp_t kStartNs = 1'500'000'000 * kSecondNs;
const GeodeticPosition kOrigin{48.0, 11.0, 500.0};

// A camera that drives east at 10 m/s, seen at `time_s`.
Eigen::Vector3d PositionAt(double time_s) { return {10.0 * time_s, 0.0, 0.0}; }

std::vector<ImageStamp> Images(int num, double period_s) {
  std::vector<ImageStamp> images;
  for (int i = 0; i < num; ++i) {
    images.push_back({static_cast<image_t>(i + 1), std::to_string(i),
                      kStartNs + std::llround(i * period_s * kSecondNs)});
  }
  return images;
}

std::vector<GnssFix> Fixes(int num, double period_s, double clock_s) {
  std::vector<GnssFix> fixes;
  for (int i = 0; i < num; ++i) {
    GnssFix fix;
    fix.timestamp_ns =
        kStartNs + std::llround((i * period_s - clock_s) * kSecondNs);
    fix.position = EnuFrame(kOrigin).GeodeticFromEnu(PositionAt(i * period_s));
    fix.covariance = 4.0 * Eigen::Matrix3d::Identity();
    fixes.push_back(fix);
  }
  return fixes;
}

// The position that the poses of a prior's two images predict.
Eigen::Vector3d Predict(const PositionPrior& prior, double period_s) {
  return (1.0 - prior.share) * PositionAt((prior.image_id1 - 1.0) * period_s) +
         prior.share * PositionAt((prior.image_id2 - 1.0) * period_s);
}

TEST(PositionPriors, FixesBetweenNearImagesBelongToBoth) {
  SensorCalibration calibration;
  const auto result = ComputePositionPriors({}, calibration, Images(100, 0.1),
                                            Fixes(12, 0.97, 0.0));
  ASSERT_TRUE(result.ok()) << result.status().message();
  // The last fix is at 10.67 s, after the last image.
  EXPECT_EQ(result->num_fixes_outside, 1);
  ASSERT_EQ(result->priors.size(), 11u);
  for (const PositionPrior& prior : result->priors) {
    EXPECT_LT((Predict(prior, 0.1) - prior.position).norm(), 1e-6);
    EXPECT_NEAR(prior.covariance(0, 0), 4.0, 1e-12);
  }
  EXPECT_EQ(result->origin.latitude_deg, 48.0);
}

TEST(PositionPriors, FarImagesGetPositionsBetweenFixes) {
  const auto result =
      ComputePositionPriors({}, {}, Images(5, 2.3), Fixes(10, 1.0, 0.0));
  ASSERT_TRUE(result.ok()) << result.status().message();
  // The image at 9.2 s comes after the last fix.
  ASSERT_EQ(result->priors.size(), 4u);
  for (const PositionPrior& prior : result->priors) {
    EXPECT_EQ(prior.image_id1, prior.image_id2);
    EXPECT_LT((Predict(prior, 2.3) - prior.position).norm(), 1e-6);
    EXPECT_LE(prior.covariance(0, 0), 4.0);
    EXPECT_GE(prior.covariance(0, 0), 2.0);
  }
}

TEST(PositionPriors, ClocksAndLeverArmAreTheCalibrations) {
  SensorCalibration calibration;
  calibration.cam_from_imu =
      Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1.0, 0.0, 0.0));
  calibration.timeshift_cam_imu_s = 0.2;
  calibration.has_gnss = true;
  calibration.antenna_in_imu = {0.0, 2.0, 0.0};
  // The receiver's clock is 0.5 s behind the IMU's, the camera's 0.2 s.
  calibration.timeshift_gnss_imu_s = 0.5;
  std::vector<GnssFix> fixes = Fixes(9, 1.0, 0.5);
  for (GnssFix& fix : fixes) fix.timestamp_ns += kSecondNs / 5;
  const auto result =
      ComputePositionPriors({}, calibration, Images(100, 0.1), fixes);
  ASSERT_TRUE(result.ok()) << result.status().message();
  ASSERT_EQ(result->priors.size(), 9u);
  for (const PositionPrior& prior : result->priors) {
    EXPECT_LT((Predict(prior, 0.1) - prior.position).norm(), 1e-6);
    EXPECT_LT((prior.antenna_in_cam - Eigen::Vector3d(1.0, 2.0, 0.0)).norm(),
              1e-12);
  }
}

TEST(PositionPriors, GapsOfTheLogAreNotBridged) {
  std::vector<GnssFix> fixes = Fixes(40, 1.0, 0.0);
  fixes.erase(fixes.begin() + 10, fixes.begin() + 20);
  const auto bridged = ComputePositionPriors({}, {}, Images(16, 2.5), fixes);
  ASSERT_TRUE(bridged.ok());
  for (const PositionPrior& prior : bridged->priors) {
    const double time_s = 2.5 * (prior.image_id1 - 1);
    EXPECT_TRUE(time_s <= 9.0 || time_s >= 20.0) << time_s;
  }
  PositionPriorOptions options;
  options.max_fix_gap_s = 20.0;
  const auto all = ComputePositionPriors(options, {}, Images(16, 2.5), fixes);
  EXPECT_GT(all->priors.size(), bridged->priors.size());
}

TEST(PositionPriors, CorrelatedErrorsCountLess) {
  PositionPriorOptions options;
  options.correlation_time_s = 10.0;
  const auto result =
      ComputePositionPriors(options, {}, Images(100, 0.1), Fixes(9, 1.0, 0.0));
  ASSERT_TRUE(result.ok());
  EXPECT_NEAR(result->priors[0].covariance(0, 0), 80.0, 1e-6);
}

TEST(PositionPriors, AnotherDayIsAnErrorWithBothSpans) {
  std::vector<GnssFix> fixes = Fixes(9, 1.0, 0.0);
  for (GnssFix& fix : fixes) fix.timestamp_ns += 86'400 * kSecondNs;
  const auto result = ComputePositionPriors({}, {}, Images(100, 0.1), fixes);
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.status().message().find("86400"), std::string::npos);
  EXPECT_NE(result.status().message().find("another day"), std::string::npos);
}

TEST(PositionPriors, OptionsAreChecked) {
  PositionPriorOptions options;
  std::string error;
  EXPECT_TRUE(options.IsValid(&error));
  options.max_fix_gap_s = -1.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_NE(error.find("AdaSfmGnss.max_fix_gap_s"), std::string::npos);
}

}  // namespace
}  // namespace adasfm
