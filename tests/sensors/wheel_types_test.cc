// SPDX-License-Identifier: BSD-3-Clause
// Steering and one-wheel encoders, on drives of a simulator of their own: the
// bicycle model, integrated in small steps.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/estimate_priors.h"

namespace adasfm {
namespace {

constexpr double kWheelbaseM = 2.7;
constexpr double kWheelOffsetM = 0.8;  // of the left rear wheel
constexpr double kMetresPerTick = 0.01;
constexpr double kDurationS = 40.0;
constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;

// The rear axle's centre in the plane.
struct AxleState {
  double x = 0.0, y = 0.0, heading = 0.0;
  double left_distance_m = 0.0;
};

double SpeedAt(double t) { return 4.0 + 2.0 * std::sin(0.4 * t); }
double SteeringAt(double t) { return 0.25 * std::sin(0.5 * t + 0.3); }
double YawRateAt(double t) {
  return SpeedAt(t) * std::tan(SteeringAt(t)) / kWheelbaseM;
}

timestamp_t TimeNs(double t) { return kStartNs + std::llround(1e9 * t); }

// A drive: logs of all kinds, images every 0.2 s, and their true poses.
class Drive {
 public:
  Drive() {
    // The camera looks forward, beside the axle.
    Eigen::Matrix3d cam_from_body;
    cam_from_body << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    calibration_.cam_from_imu =
        Rigid3d(Eigen::Quaterniond(cam_from_body),
                cam_from_body * Eigen::Vector3d(-1.5, 0.2, -1.0));
    calibration_.has_wheel = true;
    calibration_.wheel_speed_noise = 0.02;
    calibration_.wheel_yaw_rate_noise = 0.01;
    constexpr double kStepS = 1e-4;
    AxleState state;
    const int num_steps = static_cast<int>(std::round(kDurationS / kStepS));
    for (int i = 0; i <= num_steps; ++i) {
      const double t = i * kStepS;
      if (i % 100 == 0) AddSamples(t, state);
      // Speeds need two counts, so there are no images at the log's ends.
      if (i % 2000 == 1000) AddImage(t, state);
      Advance(t + 0.5 * kStepS, kStepS, &state);
    }
  }

  // Rms of the errors of the priors, and the chain's error at its end.
  struct Errors {
    double translation_m = 0.0;
    double rotation_deg = 0.0;
    double end_share = 0.0;  // of the way
  };
  Errors Measure(const PriorEstimate& estimate) const {
    Errors errors;
    Rigid3d chain = cams_from_world_.front();
    for (const RelativePosePrior& prior : estimate.priors) {
      EXPECT_TRUE(prior.HasRotation() && prior.HasLength());
      const Rigid3d truth = cams_from_world_[prior.image_id2 - 1] *
                            cams_from_world_[prior.image_id1 - 1].Inverse();
      errors.translation_m += (prior.cam2_from_cam1.TargetOriginInSource() -
                               truth.TargetOriginInSource())
                                  .squaredNorm();
      errors.rotation_deg += std::pow(
          RadToDeg(
              prior.cam2_from_cam1.rotation.angularDistance(truth.rotation)),
          2);
      chain = prior.cam2_from_cam1 * chain;
    }
    const double num = static_cast<double>(estimate.priors.size());
    errors.translation_m = std::sqrt(errors.translation_m / num);
    errors.rotation_deg = std::sqrt(errors.rotation_deg / num);
    errors.end_share = (chain.TargetOriginInSource() -
                        cams_from_world_.back().TargetOriginInSource())
                           .norm() /
                       distance_m_;
    return errors;
  }

  StatusOr<PriorEstimate> Estimate() const {
    return EstimatePriors(images_, logs_, calibration_, {}, {});
  }

  void UseSteering() {
    calibration_.wheel_type = WheelType::kSteering;
    calibration_.wheelbase_m = kWheelbaseM;
    logs_.wheel = steering_;
  }

  // The counter of the left rear wheel, with the gyroscope for the yaw.
  void UseEncoder() {
    calibration_.wheel_type = WheelType::kEncoder;
    calibration_.metres_per_tick = kMetresPerTick;
    calibration_.imu_from_wheel.translation =
        Eigen::Vector3d(0.0, kWheelOffsetM, 0.0);
    calibration_.has_imu = true;
    logs_.wheel = ticks_;
    logs_.imu = imu_;
  }

  SensorCalibration calibration_;
  SensorLogs logs_;
  std::vector<ImageStamp> images_;

 private:
  void Advance(double t, double dt, AxleState* state) {
    const double speed = SpeedAt(t), yaw = YawRateAt(t) * dt;
    const double middle = state->heading + 0.5 * yaw;
    state->x += speed * dt * std::cos(middle);
    state->y += speed * dt * std::sin(middle);
    state->heading += yaw;
    state->left_distance_m += speed * dt - kWheelOffsetM * yaw;
    distance_m_ += speed * dt;
  }

  void AddSamples(double t, const AxleState& state) {
    const timestamp_t time_ns = TimeNs(t);
    steering_.push_back({time_ns, SpeedAt(t) + random_.Gaussian(0.02),
                         SteeringAt(t) + random_.Gaussian(0.002)});
    ticks_.push_back(
        {time_ns, std::floor(state.left_distance_m / kMetresPerTick), 0.0});
    ImuSample imu;
    imu.timestamp_ns = time_ns;
    imu.angular_velocity.z() = YawRateAt(t);
    // At the axle's centre: force along and across the path, and gravity.
    imu.specific_force =
        Eigen::Vector3d((SpeedAt(t + 1e-3) - SpeedAt(t - 1e-3)) / 2e-3,
                        SpeedAt(t) * YawRateAt(t), 9.81);
    imu.angular_velocity += random_.GaussianVector(0.002);
    imu.specific_force += random_.GaussianVector(0.05);
    imu_.push_back(imu);
  }

  void AddImage(double t, const AxleState& state) {
    ImageStamp image;
    image.image_id = static_cast<image_t>(images_.size() + 1);
    image.name = std::to_string(image.image_id);
    image.timestamp_ns = TimeNs(t);
    images_.push_back(image);
    const Rigid3d world_from_axle(Eigen::Quaterniond(Eigen::AngleAxisd(
                                      state.heading, Eigen::Vector3d::UnitZ())),
                                  Eigen::Vector3d(state.x, state.y, 0.0));
    cams_from_world_.push_back(calibration_.cam_from_imu *
                               world_from_axle.Inverse());
  }

  Random random_{7};
  double distance_m_ = 0.0;
  std::vector<WheelSample> steering_;
  std::vector<WheelSample> ticks_;
  std::vector<ImuSample> imu_;
  std::vector<Rigid3d> cams_from_world_;
};

TEST(WheelTypes, SteeringAloneGivesPlanarMotion) {
  Drive drive;
  drive.UseSteering();
  const StatusOr<PriorEstimate> estimate = drive.Estimate();
  ASSERT_TRUE(estimate.ok()) << estimate.status().message();
  ASSERT_EQ(estimate->priors.size(), drive.images_.size() - 1);
  const Drive::Errors errors = drive.Measure(*estimate);
  EXPECT_LT(errors.translation_m, 0.01);
  EXPECT_LT(errors.rotation_deg, 0.1);
  EXPECT_LT(errors.end_share, 0.01);

  // A wrong wheelbase gives wrong rotations.
  drive.calibration_.wheelbase_m = 1.1 * kWheelbaseM;
  const StatusOr<PriorEstimate> longer = drive.Estimate();
  ASSERT_TRUE(longer.ok());
  EXPECT_GT(drive.Measure(*longer).rotation_deg, 2.0 * errors.rotation_deg);
}

TEST(WheelTypes, SteeringAgreesWithTheGyroscope) {
  Drive drive;
  drive.UseEncoder();
  drive.UseSteering();
  drive.calibration_.imu_from_wheel = Rigid3d();
  const StatusOr<PriorEstimate> estimate = drive.Estimate();
  ASSERT_TRUE(estimate.ok()) << estimate.status().message();
  const Drive::Errors errors = drive.Measure(*estimate);
  EXPECT_LT(errors.rotation_deg, 0.05);
  EXPECT_LT(errors.end_share, 0.01);
  EXPECT_NEAR(estimate->summary.wheel_scale, 1.0, 0.01);
}

// The wheel is beside the axle's centre and drives further outside of bends.
TEST(WheelTypes, OneEncoderWithGyroscopeGivesMetres) {
  Drive drive;
  drive.UseEncoder();
  const StatusOr<PriorEstimate> estimate = drive.Estimate();
  ASSERT_TRUE(estimate.ok()) << estimate.status().message();
  const Drive::Errors errors = drive.Measure(*estimate);
  EXPECT_LT(errors.translation_m, 0.02);
  EXPECT_LT(errors.end_share, 0.01);
  drive.calibration_.imu_from_wheel = Rigid3d();
  const StatusOr<PriorEstimate> misplaced = drive.Estimate();
  ASSERT_TRUE(misplaced.ok());
  EXPECT_GT(drive.Measure(*misplaced).translation_m,
            1.5 * errors.translation_m);
}

// Wheels on a clock of their own: a search finds the time offset roughly, and
// the smoother estimates the remainder.
TEST(WheelTypes, TheClockOfTheWheelsIsCorrected) {
  for (const double shift_s : {-0.12, -0.04, 0.0, 0.05}) {
    Drive drive;
    drive.UseEncoder();
    drive.UseSteering();
    drive.calibration_.imu_from_wheel = Rigid3d();
    for (WheelSample& sample : drive.logs_.wheel) {
      sample.timestamp_ns -= std::llround(1e9 * shift_s);
    }
    const StatusOr<PriorEstimate> estimate = drive.Estimate();
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    const SensorSummary& summary = estimate->summary;
    EXPECT_NEAR(summary.wheel_clock_shift_s - summary.wheel_delay_s, shift_s,
                0.005);
    EXPECT_EQ(summary.wheel_clock_shift_s != 0.0, shift_s == -0.12);
    EXPECT_LT(drive.Measure(*estimate).end_share, 0.01);
  }
}

}  // namespace
}  // namespace adasfm
