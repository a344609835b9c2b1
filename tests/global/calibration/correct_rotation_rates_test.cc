// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/correct_rotation_rates.h"

#include <gtest/gtest.h>

#include "core/so3.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

struct Drive {
  ViewGraph graph;
  std::vector<RelativePosePrior> priors;
  std::vector<RelativePosePrior> true_priors;
};

// 0.1 s a step. The priors turn by a constant rate too much; every pair of up
// to five steps has a visual rotation.
Drive BuildDrive(const Eigen::Vector3d& bias_rad_s, double vision_sigma_rad,
                 int num_wrong_pairs, uint64_t seed) {
  constexpr int kNumImages = 400;
  Random random(seed);
  Drive drive;
  std::vector<Rigid3d> poses = {Rigid3d()};
  drive.graph.images = {1};
  for (int k = 1; k < kNumImages; ++k) {
    const Rigid3d step(ExpSo3(Eigen::Vector3d(0, 0.05 * std::sin(0.02 * k), 0)),
                       Eigen::Vector3d(0, 0, -1));
    poses.push_back(step * poses.back());
    drive.graph.images.push_back(k + 1);
    drive.true_priors.push_back(BuildPrior(k, k + 1, step, 0, 0, &random));
    drive.priors.push_back(BuildPrior(k, k + 1, step, 1e-4, 1e-2, &random));
    Eigen::Quaterniond& rotation = drive.priors.back().cam2_from_cam1.rotation;
    rotation = ExpSo3(0.1 * bias_rad_s) * rotation;
  }
  for (int i = 0; i < kNumImages; ++i) {
    for (int j = i + 1; j < std::min(kNumImages, i + 6); ++j) {
      Rigid3d motion = poses[j] * poses[i].Inverse();
      motion.rotation =
          ExpSo3(random.GaussianVector(vision_sigma_rad)) * motion.rotation;
      drive.graph.edges.push_back(BuildEdge(ImagePair(i + 1, j + 1), motion));
      drive.graph.edges.back().rotation_sigma_rad = vision_sigma_rad;
    }
  }
  for (const int e : random.Sample(num_wrong_pairs, drive.graph.edges.size())) {
    Eigen::Quaterniond& rotation = drive.graph.edges[e].cam2_from_cam1.rotation;
    rotation = ExpSo3(random.GaussianVector(0.1)) * rotation;
  }
  return drive;
}

// The drives' gyroscopes are worse than usual.
RotationRateOptions RateOptions() {
  RotationRateOptions options;
  options.rate_sigma_rad_s = 1e-3;
  return options;
}

// Of the whole drive, between its ends.
double EndError(const Drive& drive, const std::vector<RelativePosePrior>& a) {
  Eigen::Quaterniond estimate = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond truth = Eigen::Quaterniond::Identity();
  for (size_t k = 0; k < a.size(); ++k) {
    estimate = a[k].cam2_from_cam1.rotation * estimate;
    truth = drive.true_priors[k].cam2_from_cam1.rotation * truth;
  }
  return LogSo3(estimate * truth.conjugate()).norm();
}

TEST(CorrectRotationRates, TakesTheBiasOutInSpiteOfWrongPairs) {
  const Eigen::Vector3d bias(4e-4, -1e-3, 2e-4);
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Drive drive = BuildDrive(bias, 1e-3, 100, seed);
    const double before = EndError(drive, drive.priors);
    const RotationRateReport report =
        CorrectRotationRates(RateOptions(), OdometryChain(drive.priors, {}),
                             drive.graph, &drive.priors);
    EXPECT_EQ(report.num_pairs, drive.graph.edges.size());
    // The steps' own noise after 400 of them: 1e-4 sqrt(400) = 2e-3 per axis,
    // 3.5e-3 in all. 2,000 pairs of 1e-3 tell the rate to 1.3e-4 rad/s, 9e-3 at
    // the end in all. The bias alone leads to 0.04.
    EXPECT_GT(before, 0.03) << "seed " << seed;
    EXPECT_LT(EndError(drive, drive.priors), 0.015) << "seed " << seed;
    EXPECT_NEAR(report.max_rate_rad_s, bias.norm(), 0.3 * bias.norm());
  }
}

TEST(CorrectRotationRates, LeavesPriorsWithoutPairsAsTheyAre) {
  Drive drive = BuildDrive(Eigen::Vector3d(0, 1e-3, 0), 1e-3, 0, 1);
  const std::vector<RelativePosePrior> before = drive.priors;
  drive.graph.edges.clear();
  const RotationRateReport report = CorrectRotationRates(
      RotationRateOptions(), OdometryChain(drive.priors, {}), drive.graph,
      &drive.priors);
  EXPECT_EQ(report.num_pairs, 0);
  for (size_t k = 0; k < before.size(); ++k) {
    EXPECT_EQ(before[k].cam2_from_cam1.rotation.coeffs(),
              drive.priors[k].cam2_from_cam1.rotation.coeffs());
  }
}

}  // namespace
}  // namespace adasfm
