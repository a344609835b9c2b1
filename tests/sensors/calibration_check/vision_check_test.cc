// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/calibration_check/rotation_comparison.h"
#include "sensors/io/log_checks.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

// A mistake of users, and the words that the error message must contain.
struct Mistake {
  const char* name;
  void (*make)(Dataset*);
  const char* words;
};

class Mistakes : public testing::TestWithParam<Mistake> {};

TEST_P(Mistakes, AreNamed) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 120));
    Dataset data = ToDataset(world);
    GetParam().make(&data);
    // As in the importer, the reader's checks of the log alone come first.
    const Status units = CheckImuUnits(
        data.logs.imu,
        LogOrigin::Numbered("imu.csv", data.logs.imu.size(), "line"));
    if (!units.ok()) {
      EXPECT_NE(units.message().find(GetParam().words), std::string::npos)
          << units.message();
      EXPECT_NE(units.message().find("imu.csv, line"), std::string::npos);
      continue;
    }
    const std::vector<VisualRotation> vision = SimulateVision(world, seed);
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration, vision, {});
    ASSERT_FALSE(estimate.ok()) << GetParam().name;
    EXPECT_NE(estimate.status().message().find(GetParam().words),
              std::string::npos)
        << estimate.status().message();
    // The user may switch the check off.
    PriorEstimationOptions options;
    options.check_against_vision = false;
    EXPECT_TRUE(EstimatePriors(data.images, data.logs, data.calibration, vision,
                               options)
                    .ok());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, Mistakes,
    testing::Values(Mistake{"SwappedAxes",
                            [](Dataset* data) {
                              for (ImuSample& s : data->logs.imu) {
                                std::swap(s.angular_velocity.y(),
                                          s.angular_velocity.z());
                                std::swap(s.specific_force.y(),
                                          s.specific_force.z());
                              }
                            },
                            "axes"},
                    Mistake{"InvertedExtrinsics",
                            [](Dataset* data) {
                              data->calibration.cam_from_imu =
                                  data->calibration.cam_from_imu.Inverse();
                            },
                            "inverted"},
                    Mistake{"Degrees",
                            [](Dataset* data) {
                              for (ImuSample& s : data->logs.imu) {
                                s.angular_velocity *= RadToDeg(1.0);
                              }
                            },
                            "deg/s"},
                    Mistake{"GravitiesForMetres",
                            [](Dataset* data) {
                              for (ImuSample& s : data->logs.imu) {
                                s.specific_force /= 9.81;
                              }
                            },
                            "m/s^2"},
                    Mistake{"OneSecond",
                            [](Dataset* data) {
                              for (ImuSample& s : data->logs.imu) {
                                s.timestamp_ns += 1'000'000'000;
                              }
                            },
                            "timeshift_cam_imu"}),
    [](const testing::TestParamInfo<Mistake>& mistake) {
      return mistake.param.name;
    });

TEST(VisionCheck, FindsTheTimeShift) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions world_options = SmallWorld(seed, 120);
    world_options.timeshift_cam_imu_s = 0.0623;
    const SyntheticWorld world = BuildSyntheticWorld(world_options);
    Dataset data = ToDataset(world);
    data.calibration.timeshift_cam_imu_s = 0.0;
    PriorEstimationOptions options;
    options.estimate_time_shift = 1;
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed), options);
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    EXPECT_NEAR(estimate->summary.timeshift_cam_imu_s, 0.0623, 0.01);
  }
}

PriorEstimate EstimateFrom(const Dataset& data,
                           const std::vector<VisualRotation>& vision) {
  const StatusOr<PriorEstimate> estimate =
      EstimatePriors(data.images, data.logs, data.calibration, vision, {});
  EXPECT_TRUE(estimate.ok()) << estimate.status().message();
  return estimate.ok() ? *estimate : PriorEstimate();
}

// Phone-sized time offsets that vision clearly observes are corrected.
TEST(VisionCheck, ClearClockShiftsAreCorrected) {
  for (const double shift_s : {-0.053, -0.045, 0.062, 0.12}) {
    SyntheticWorldOptions world_options = SmallWorld(4, 120);
    world_options.timeshift_cam_imu_s = shift_s;
    const SyntheticWorld world = BuildSyntheticWorld(world_options);
    Dataset data = ToDataset(world);
    data.calibration.timeshift_cam_imu_s = 0.0;
    const PriorEstimate estimate = EstimateFrom(data, SimulateVision(world, 4));
    EXPECT_NEAR(estimate.summary.timeshift_cam_imu_s, shift_s, 0.01);
    EXPECT_TRUE(estimate.summary.timeshift_was_corrected);
    ASSERT_FALSE(estimate.summary.warnings.empty());
    EXPECT_NE(estimate.summary.warnings[0].find("timeshift_cam_imu"),
              std::string::npos);
  }
}

TEST(VisionCheck, InsignificantShiftsAreNotApplied) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 120));
    const Dataset data = ToDataset(world);
    const PriorEstimate estimate =
        EstimateFrom(data, SimulateVision(world, seed));
    EXPECT_EQ(estimate.summary.timeshift_cam_imu_s,
              data.calibration.timeshift_cam_imu_s);
    EXPECT_FALSE(estimate.summary.timeshift_was_corrected);
    EXPECT_FALSE(estimate.summary.imu_was_left_out);
  }
}

// The rotations between images and the next two, so that triangles close.
std::vector<VisualRotation> Film(
    const Dataset& data, const std::map<image_t, Eigen::Quaterniond>& shown,
    Random* random) {
  std::vector<VisualRotation> rotations;
  for (size_t i = 0; i < data.images.size(); ++i) {
    for (size_t k = i + 1; k < std::min(i + 3, data.images.size()); ++k) {
      const image_t image_id1 = data.images[i].image_id;
      const image_t image_id2 = data.images[k].image_id;
      rotations.push_back(
          {image_id1, image_id2,
           ExpSo3(random->GaussianVector(5e-4)) * shown.at(image_id2) *
               shown.at(image_id1).conjugate(),
           100});
    }
  }
  return rotations;
}

// The camera's rotations, or as a stabilised video shows them: means over a
// second, which keep the bends and remove the shaking.
std::map<image_t, Eigen::Quaterniond> ShownRotations(const Dataset& data,
                                                     bool is_stabilized) {
  std::map<image_t, Eigen::Quaterniond> shown;
  const std::vector<ImageStamp>& images = data.images;
  const size_t reach = is_stabilized ? 3 : 0;
  for (size_t i = 0; i < images.size(); ++i) {
    const Eigen::Quaterniond center =
        data.cams_from_world.at(images[i].image_id).rotation;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    const size_t begin = i < reach ? 0 : i - reach;
    const size_t end = std::min(images.size(), i + reach + 1);
    for (size_t k = begin; k < end; ++k) {
      sum += LogSo3(data.cams_from_world.at(images[k].image_id).rotation *
                    center.conjugate());
    }
    shown[images[i].image_id] = ExpSo3(sum / (end - begin)) * center;
  }
  return shown;
}

// Simulates a hand-held camera: rotates each image by some degrees, and changes
// the gyroscope's log accordingly.
void Shake(double amplitude_rad, double speed, Dataset* data) {
  const auto turn_at = [=](timestamp_t time_ns) -> Eigen::Vector3d {
    const double t = speed * SecondsFromNs(time_ns % 1'000'000'000'000);
    return amplitude_rad * Eigen::Vector3d(std::sin(9.0 * t + 1.0),
                                           std::sin(11.0 * t),
                                           std::sin(7.0 * t + 2.0));
  };
  const timestamp_t shift_ns =
      std::llround(1e9 * data->calibration.timeshift_cam_imu_s);
  const Eigen::Quaterniond cam_from_imu =
      data->calibration.cam_from_imu.rotation;
  for (const ImageStamp& image : data->images) {
    Rigid3d& pose = data->cams_from_world.at(image.image_id);
    const Eigen::Quaterniond imu_from_world =
        cam_from_imu.conjugate() * pose.rotation;
    pose.rotation = cam_from_imu *
                    ExpSo3(turn_at(image.timestamp_ns + shift_ns)).conjugate() *
                    imu_from_world;
  }
  for (ImuSample& sample : data->logs.imu) {
    const timestamp_t time_ns = sample.timestamp_ns;
    constexpr timestamp_t kStepNs = 1'000'000;
    const Eigen::Quaterniond turn = ExpSo3(turn_at(time_ns));
    const Eigen::Quaterniond next = ExpSo3(turn_at(time_ns + kStepNs));
    sample.angular_velocity =
        turn.conjugate() * sample.angular_velocity +
        LogSo3(turn.conjugate() * next) / SecondsFromNs(kStepNs);
    sample.specific_force = turn.conjugate() * sample.specific_force;
  }
}

TEST(VisionCheck, StabilizedVideoLeavesTheImuOut) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 150));
    Dataset data = ToDataset(world);
    data.logs.wheel.clear();
    data.calibration.has_wheel = false;
    Shake(DegToRad(2.0), 1.0, &data);
    Random random(seed);
    const PriorEstimate estimate =
        EstimateFrom(data, Film(data, ShownRotations(data, true), &random));
    EXPECT_TRUE(estimate.summary.imu_was_left_out);
    EXPECT_TRUE(estimate.priors.empty());
    EXPECT_TRUE(estimate.gravity_in_cam.empty());
    ASSERT_FALSE(estimate.summary.warnings.empty());
    EXPECT_NE(estimate.summary.warnings.back().find("stabilisation"),
              std::string::npos);

    // The same shaking without stabilisation.
    const PriorEstimate honest =
        EstimateFrom(data, Film(data, ShownRotations(data, false), &random));
    EXPECT_FALSE(honest.summary.imu_was_left_out);
    EXPECT_EQ(honest.priors.size(), data.images.size() - 1);
  }
}

// The camera's rotations at random offsets from the times of the images.
std::map<image_t, Eigen::Quaterniond> RotationsAtJitteredTimes(
    const Dataset& data, double sigma_s, Random* random) {
  std::map<image_t, Eigen::Quaterniond> shown = ShownRotations(data, false);
  const std::vector<ImageStamp>& images = data.images;
  for (size_t i = 0; i + 1 < images.size(); ++i) {
    const Rigid3d& pose = data.cams_from_world.at(images[i].image_id);
    const Rigid3d& next = data.cams_from_world.at(images[i + 1].image_id);
    const double dt_s =
        SecondsFromNs(images[i + 1].timestamp_ns - images[i].timestamp_ns);
    const Eigen::Vector3d rate =
        LogSo3(next.rotation * pose.rotation.conjugate()) / dt_s;
    shown[images[i].image_id] =
        ExpSo3(random->Gaussian(sigma_s) * rate) * pose.rotation;
  }
  return shown;
}

// Image times jitter by 10 ms, intervals by sqrt(2) of that. Exact times must
// show no jitter.
TEST(VisionCheck, JitterOfTheImagesWidensThePriors) {
  constexpr double kSigmaS = 0.01;
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 200));
    Dataset data = ToDataset(world);
    Shake(DegToRad(10.0), 0.2, &data);
    Random random(seed);
    const PriorEstimate exact =
        EstimateFrom(data, Film(data, ShownRotations(data, false), &random));
    EXPECT_EQ(exact.summary.unexplained_rotation.interval_time_sigma_s, 0.0);
    const PriorEstimate jittered = EstimateFrom(
        data,
        Film(data, RotationsAtJitteredTimes(data, kSigmaS, &random), &random));
    const double expected = std::sqrt(2.0) * kSigmaS;
    EXPECT_NEAR(jittered.summary.unexplained_rotation.interval_time_sigma_s,
                expected, 0.25 * expected);
    const auto rotation_variance = [](const RelativePosePrior& prior) {
      return prior.covariance.topLeftCorner<3, 3>().trace();
    };
    double wider = 0.0, turns = 0.0;
    for (size_t i = 0; i < exact.priors.size(); ++i) {
      wider += rotation_variance(jittered.priors[i]) -
               rotation_variance(exact.priors[i]);
      turns += LogSo3(exact.priors[i].cam2_from_cam1.rotation).squaredNorm() /
               std::pow(SecondsFromNs(exact.priors[i].dt_ns), 2);
    }
    // Summed over all three axes.
    EXPECT_NEAR(wider, 3.0 * expected * expected * turns,
                0.6 * 3.0 * expected * expected * turns);
  }
}

// With 0.2 s between frames, the time offset is found to a hundredth of a frame
// and without bias, also with a slightly wrong T_cam_imu.
TEST(VisionCheck, TimeShiftsAreExactAndUnbiased) {
  constexpr int kNumSeeds = 20;
  double sum = 0.0, squares = 0.0;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    SyntheticWorldOptions world_options = SmallWorld(seed, 120);
    world_options.timeshift_cam_imu_s = 0.0623 + 0.003 * (seed - 10);
    const SyntheticWorld world = BuildSyntheticWorld(world_options);
    Dataset data = ToDataset(world);
    data.calibration.timeshift_cam_imu_s = 0.0;
    Random random(seed);
    data.calibration.cam_from_imu.rotation =
        ExpSo3(random.GaussianVector(DegToRad(0.5))) *
        data.calibration.cam_from_imu.rotation;
    PriorEstimationOptions options;
    options.estimate_time_shift = 1;
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed, {1e-3, 3, 0.02}), options);
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    const double error = estimate->summary.timeshift_cam_imu_s -
                         world_options.timeshift_cam_imu_s;
    sum += error;
    squares += error * error;
  }
  const double rms = std::sqrt(squares / kNumSeeds);
  EXPECT_LT(rms, 0.002);
  EXPECT_LT(std::abs(sum / kNumSeeds), 3.0 * rms / std::sqrt(kNumSeeds));
  RecordProperty("rms_ms", std::to_string(1e3 * rms));
  RecordProperty("mean_ms", std::to_string(1e3 * sum / kNumSeeds));
}

// On a straight road the cameras hardly rotate, less than the noise of vision.
// A right calibration must not be rejected because of that.
TEST(VisionCheck, AcceptsARightCalibrationOnAStraightRoad) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    SyntheticWorldOptions options = SmallWorld(seed, 51);
    options.trajectory = SyntheticTrajectory::kStraight;
    options.standstill_s = seed % 2 == 0 ? 3.0 : 0.0;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const Dataset data = ToDataset(world);
    for (const double sigma_deg : {0.02, 0.1, 0.5}) {
      const VisionNoise noise = {DegToRad(sigma_deg), 3, 0.02};
      const StatusOr<PriorEstimate> estimate =
          EstimatePriors(data.images, data.logs, data.calibration,
                         SimulateVision(world, seed, noise), {});
      EXPECT_TRUE(estimate.ok()) << "seed " << seed << ", noise " << sigma_deg
                                 << " deg: " << estimate.status().message();
    }
  }
}

// Images of one drive with the log of another: rejected, or at least reported
// as not checkable (two drives through blocks may bend at the same times).
TEST(VisionCheck, NoticesTheLogOfAnotherDrive) {
  int num_refused = 0;
  for (const uint64_t seed : {1, 2, 3, 4, 5, 6}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 120));
    const SyntheticWorld other =
        BuildSyntheticWorld(SmallWorld(seed + 100, 120));
    Dataset data = ToDataset(world);
    data.logs = ToDataset(other).logs;
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed), {});
    num_refused += !estimate.ok();
    if (!estimate.ok()) continue;
    ASSERT_FALSE(estimate->summary.warnings.empty()) << "seed " << seed;
    EXPECT_NE(estimate->summary.warnings[0].find("cannot be checked"),
              std::string::npos);
  }
  EXPECT_GE(num_refused, 3);
}

// Under the truth, a wrong explanation is e^x times likelier in at most e^-x of
// all cases, whether errors have short tails or long ones.
TEST(Evidence, OfChanceIsSmall) {
  Random random(1);
  constexpr int kNumTrials = 5000;
  for (const double wrong_ratio : {0.0, 0.1}) {
    int num_beyond_three = 0;
    for (int trial = 0; trial < kNumTrials; ++trial) {
      std::vector<double> truth, wrong;
      for (int i = 0; i < 60; ++i) {
        const bool is_wrong = random.Uniform(0.0, 1.0) < wrong_ratio;
        const Eigen::Vector3d error = random.GaussianVector(is_wrong ? 9 : 1);
        truth.push_back(error.norm());
        wrong.push_back((error + random.GaussianVector(0.2)).norm());
      }
      num_beyond_three += ComputeEvidence(truth, wrong, 1.0) > 3.0;
    }
    // e^-3 of them would be 249.
    EXPECT_LE(num_beyond_three, 249);
  }
}

TEST(Evidence, CountsRepeatsOnceAndHasASign) {
  const std::vector<double> small(20, 0.1), large(20, 1.0);
  const double evidence = ComputeEvidence(large, small, 1.0);
  EXPECT_GT(evidence, 20.0);
  EXPECT_NEAR(ComputeEvidence(large, small, 4.0), evidence / 4.0, 1e-9);
  EXPECT_LT(ComputeEvidence(small, large, 1.0), -20.0);
  EXPECT_EQ(ComputeEvidence(large, large, 1.0), 0.0);
}

TEST(VisionCheck, AcceptsARightCalibration) {
  for (const uint64_t seed : {4, 5, 6}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed));
    const Dataset data = ToDataset(world);
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed), {});
    EXPECT_TRUE(estimate.ok()) << estimate.status().message();
  }
}

// Logs that end or begin in the middle of a drive cover less than half of the
// images, and no time offset covers more. That is no evidence of an offset.
TEST(VisionCheck, AcceptsLogsOfAPartOfTheDrive) {
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const SyntheticWorld world = BuildSyntheticWorld(SmallWorld(seed, 120));
    const bool ends = seed % 2 == 0;
    Dataset data = ToDataset(world);
    // Just under a half of the images.
    const timestamp_t time_ns =
        world.images[ends ? 58 : 60].timestamp_ns + 50'000'000;
    const auto is_cut = [&](const auto& sample) {
      return ends == (sample.timestamp_ns > time_ns);
    };
    std::vector<ImuSample>& imu = data.logs.imu;
    imu.erase(std::remove_if(imu.begin(), imu.end(), is_cut), imu.end());
    std::vector<WheelSample>& wheels = data.logs.wheel;
    wheels.erase(std::remove_if(wheels.begin(), wheels.end(), is_cut),
                 wheels.end());
    const StatusOr<PriorEstimate> estimate =
        EstimatePriors(data.images, data.logs, data.calibration,
                       SimulateVision(world, seed, {1e-3, 3, 0.02}), {});
    ASSERT_TRUE(estimate.ok()) << estimate.status().message();
    EXPECT_NEAR(estimate->summary.visual_timeshift_correction_s, 0.0, 0.005);
    EXPECT_EQ(estimate->summary.gyroscope_lag_s, 0.0);
  }
}

}  // namespace
}  // namespace adasfm
