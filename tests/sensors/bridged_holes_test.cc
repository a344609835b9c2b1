// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bridged_holes.h"

#include <gtest/gtest.h>

#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

// The squared error that a hole causes, against the log without the hole and in
// units of the added variance, is near one on average.
TEST(BridgedHoles, VarianceIsThatOfTheError) {
  const Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(2, 120)));
  const std::vector<ImuSample>& imu = data.logs.imu;
  constexpr size_t kHole = 12, kLink = 40;
  double rotation_chi2 = 0.0, velocity_chi2 = 0.0;
  int count = 0;
  for (size_t begin = 700; begin + 2 * kLink < imu.size(); begin += 50) {
    MotionLogs logs;
    logs.imu = imu;
    logs.imu.erase(logs.imu.begin() + begin + 10,
                   logs.imu.begin() + begin + 10 + kHole);
    const std::vector<timestamp_t> times_ns = {imu[begin].timestamp_ns,
                                               imu[begin + kLink].timestamp_ns};
    const auto integrate = [&](const std::vector<ImuSample>& samples) {
      return PreintegrateImu(samples, times_ns[0], times_ns[1], ImuBias(),
                             data.calibration.imu_noise);
    };
    OdometryLink link;
    link.dt_s = SecondsFromNs(times_ns[1] - times_ns[0]);
    link.has_imu = true;
    link.imu = integrate(logs.imu);
    const ImuPreintegration truth = integrate(imu);
    const auto before = link.imu.covariance;
    std::vector<OdometryLink> links = {link};
    AddHoleUncertainty(logs, times_ns, Eigen::Quaterniond::Identity(), &links);
    const auto added = (links[0].imu.covariance - before).eval();
    rotation_chi2 +=
        LogSo3(link.imu.delta_rotation.conjugate() * truth.delta_rotation)
            .squaredNorm() /
        added.topLeftCorner<3, 3>().trace();
    velocity_chi2 +=
        (link.imu.delta_velocity - truth.delta_velocity).squaredNorm() /
        added.block<3, 3>(3, 3).trace();
    ++count;
  }
  ASSERT_GT(count, 20);
  EXPECT_GT(rotation_chi2 / count, 0.4);
  EXPECT_LT(rotation_chi2 / count, 2.0);
  EXPECT_GT(velocity_chi2 / count, 0.4);
  EXPECT_LT(velocity_chi2 / count, 2.0);
}

TEST(BridgedHoles, AddNothingToWholeLogs) {
  const Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(2)));
  MotionLogs logs;
  logs.imu = data.logs.imu;
  const std::vector<timestamp_t> times_ns = {logs.imu[100].timestamp_ns,
                                             logs.imu[200].timestamp_ns};
  std::vector<OdometryLink> links(1);
  links[0].has_imu = true;
  AddHoleUncertainty(logs, times_ns, Eigen::Quaterniond::Identity(), &links);
  EXPECT_TRUE(links[0].imu.covariance.isZero(0.0));
}

}  // namespace
}  // namespace adasfm
