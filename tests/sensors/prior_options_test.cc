// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

enum class Sensors { kBoth, kFilteredImu };

// An option, another value for it, and the sensors with which it matters.
struct OptionChange {
  const char* name;
  void (*change)(PriorEstimationOptions*);
  Sensors sensors = Sensors::kBoth;
};

// A short drive with a standstill, a slip, a gap in both logs, a time shift and
// two-view rotations, a few of them wrong.
class Drive {
 public:
  explicit Drive(Sensors sensors) {
    SyntheticWorldOptions options = SmallWorld(3, 60);
    options.num_wheel_slips = 1;
    options.timeshift_cam_imu_s = 0.01;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    data_ = ToDataset(world);
    data_.calibration.timeshift_cam_imu_s = 0.0;
    vision_ = SimulateVision(world, 3, {1e-3, 1, 0.05});
    if (sensors == Sensors::kFilteredImu) {
      Filter(0.15, &data_.logs.imu);
      data_.calibration.timeshift_cam_imu_s = 0.13;
    }
    const timestamp_t gap_ns = data_.images[20].timestamp_ns;
    Cut(gap_ns, 60'000'000, &data_.logs.imu);
    Cut(gap_ns, 120'000'000, &data_.logs.wheel);
  }

  // All results as numbers.
  std::vector<double> Outcome(const PriorEstimationOptions& options) const {
    const StatusOr<PriorEstimate> estimate = EstimatePriors(
        data_.images, data_.logs, data_.calibration, vision_, options);
    if (!estimate.ok()) throw std::runtime_error(estimate.status().message());
    const SensorSummary& summary = estimate->summary;
    std::vector<double> values = {
        static_cast<double>(summary.num_priors),
        static_cast<double>(summary.wheel_slips.size()),
        summary.timeshift_cam_imu_s, summary.gyroscope_bias_sigma};
    for (const RelativePosePrior& prior : estimate->priors) {
      values.push_back(prior.cam2_from_cam1.translation.norm());
      for (int i = 0; i < 6; ++i) values.push_back(prior.covariance(i, i));
    }
    return values;
  }

 private:
  // Applies a low-pass filter with this time constant.
  static void Filter(double lag_s, std::vector<ImuSample>* imu) {
    for (size_t i = 1; i < imu->size(); ++i) {
      const double dt_s =
          SecondsFromNs((*imu)[i].timestamp_ns - (*imu)[i - 1].timestamp_ns);
      Eigen::Vector3d& rate = (*imu)[i].angular_velocity;
      const Eigen::Vector3d& last = (*imu)[i - 1].angular_velocity;
      rate = last + std::min(1.0, dt_s / lag_s) * (rate - last);
    }
  }

  template <typename Sample>
  static void Cut(timestamp_t start_ns, timestamp_t length_ns,
                  std::vector<Sample>* samples) {
    std::vector<Sample> kept;
    for (const Sample& sample : *samples) {
      const timestamp_t since = sample.timestamp_ns - start_ns;
      if (since < 0 || since > length_ns) kept.push_back(sample);
    }
    *samples = std::move(kept);
  }

  Dataset data_;
  std::vector<VisualRotation> vision_;
};

class EveryOption : public testing::TestWithParam<OptionChange> {};

TEST_P(EveryOption, ChangesTheOutcome) {
  const Drive drive(GetParam().sensors);
  PriorEstimationOptions options;
  const std::vector<double> before = drive.Outcome(options);
  GetParam().change(&options);
  const std::vector<double> after = drive.Outcome(options);
  EXPECT_NE(before, after);
  // The default options give the first result again.
  EXPECT_EQ(drive.Outcome({}), before);
}

using Options = PriorEstimationOptions;

INSTANTIATE_TEST_SUITE_P(
    Priors, EveryOption,
    testing::Values(
        OptionChange{"MaxImuGap",
                     [](Options* o) { o->links.max_imu_gap_s = 0.04; }},
        OptionChange{"MaxWheelGap",
                     [](Options* o) { o->links.max_wheel_gap_s = 0.1; }},
        OptionChange{"LateralSpeed",
                     [](Options* o) { o->links.lateral_speed_noise = 0.5; }},
        OptionChange{"VerticalSpeed",
                     [](Options* o) { o->links.vertical_speed_noise = 0.02; }},
        OptionChange{"UseVisualRotations",
                     [](Options* o) { o->use_visual_rotations = false; }},
        OptionChange{"UndoGyroscopeFilter",
                     [](Options* o) { o->undo_gyroscope_filter = false; },
                     Sensors::kFilteredImu},
        OptionChange{"EstimateTimeShift",
                     [](Options* o) { o->estimate_time_shift = 1; }}),
    [](const auto& change) { return change.param.name; });

INSTANTIATE_TEST_SUITE_P(
    Fusion, EveryOption,
    testing::Values(
        OptionChange{"Gravity",
                     [](Options* o) { o->fusion.gravity_m_s2 = 9.7; }},
        OptionChange{"GyroscopeBias",
                     [](Options* o) { o->fusion.gyroscope_bias_sigma = 1e-5; }},
        OptionChange{
            "AccelerometerBias",
            [](Options* o) { o->fusion.accelerometer_bias_sigma = 0.01; }},
        OptionChange{"WheelScale",
                     [](Options* o) { o->fusion.wheel_scale_sigma = 0.001; }},
        OptionChange{"WheelTrack",
                     [](Options* o) { o->fusion.wheel_track_sigma = 0.001; }},
        OptionChange{
            "WheelCurvature",
            [](Options* o) { o->fusion.wheel_curvature_sigma = 1e-5; }},
        OptionChange{
            "DrivingDirection",
            [](Options* o) { o->fusion.driving_direction_sigma_deg = 0; }}),
    [](const auto& change) { return change.param.name; });

}  // namespace
}  // namespace adasfm
