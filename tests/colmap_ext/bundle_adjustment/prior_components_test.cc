// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/prior_components.h"

#include <gtest/gtest.h>

#include "colmap_ext/bundle_adjustment/linear_adjustment.h"
#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/mapper_drive.h"

namespace adasfm {
namespace {

PriorComponent LengthsOf(int num_honest, double honest, int num_wild) {
  PriorComponents components;
  for (int i = 0; i < num_honest; ++i) {
    AddPriorTerm(PriorTerm::kLength, honest, &components);
  }
  for (int i = 0; i < num_wild; ++i) {
    AddPriorTerm(PriorTerm::kLength, 400.0, &components);
  }
  FinishPriorComponents(&components);
  return components[static_cast<size_t>(PriorTerm::kLength)];
}

// Residuals of 20 sigmas, as of slipping wheels, are clipped at three estimated
// sigmas, or three stated ones if larger: m = 0.93 * 0.5 + 0.07 * 9 m.
TEST(PriorComponents, FewSlipsDoNotSpeakForAllLengths) {
  EXPECT_NEAR(LengthsOf(93, 0.5, 7).mean_square, 0.93 * 0.5 / 0.37, 0.01);
  EXPECT_NEAR(LengthsOf(97, 0.5, 3).mean_square, 0.97 * 0.5 + 0.03 * 9.0, 0.01);
}

// An error shared by most of the lengths counts in full, whatever its size.
TEST(PriorComponents, SharedErrorsAreToldInFull) {
  EXPECT_NEAR(LengthsOf(100, 25.0, 0).mean_square, 25.0, 1e-9);
  EXPECT_NEAR(LengthsOf(50, 0.5, 50).mean_square, 200.25, 1e-9);
}

// Lengths found by vision are no measurements.
TEST(PriorComponents, LengthsOfVisionSayNothing) {
  const MapperWorld world = BuildDrive(1);
  const colmap::Reconstruction model = Reconstruct(world);
  PriorBundleAdjustmentProblem problem = ProblemOf(world, model, 1.0);
  const auto num_lengths = [&] {
    return ComputePriorComponents(
               kStatedPriorSigmas, problem.priors,
               model)[static_cast<size_t>(PriorTerm::kLength)]
        .num_residuals;
  };
  EXPECT_GT(num_lengths(), 0);
  for (PosePriorEdge& edge : problem.priors) edge.is_length_measured = false;
  EXPECT_EQ(num_lengths(), 0);
}

// Poses constrained by priors alone fit a single measurement of each motion
// exactly, and two by half: n measurements have a redundancy of 1 - 1 / n.
TEST(PriorComponents, RedundancyIsWhatMeasurementsTestOfEachOther) {
  const MapperWorld world = BuildDrive(1);
  colmap::Reconstruction model = Reconstruct(world);
  PriorBundleAdjustmentProblem problem = ProblemOf(world, model, 1.0);
  for (const colmap::point3D_t point_id : model.Point3DIds()) {
    model.DeletePoint3D(point_id);
  }
  for (PosePriorEdge& edge : problem.priors) {
    edge.cam2_from_cam1 =
        ComputeCam2FromCam1(CamFromWorld(model.Image(edge.image_id1)),
                            CamFromWorld(model.Image(edge.image_id2)));
  }
  PriorBundleAdjustmentOptions options;
  options.shared_errors.enabled = false;
  for (const int num_measurements : {1, 2, 4}) {
    PriorBundleAdjustmentProblem repeated = problem;
    for (int k = 1; k < num_measurements; ++k) {
      repeated.priors.insert(repeated.priors.end(), problem.priors.begin(),
                             problem.priors.end());
    }
    colmap::Reconstruction adjusted = model;
    std::unique_ptr<ReducedSystem> system;
    ASSERT_TRUE(AdjustBundle(options, repeated, &adjusted, &system).success);
    PriorComponents components;
    ASSERT_TRUE(LinearAdjustment(system.get(), options.prior_loss_scale)
                    .Solve(kStatedPriorSigmas, &components));
    const double share = 1.0 - 1.0 / num_measurements;
    for (int k = 0; k < 3; ++k) {
      EXPECT_GT(components[k].num_residuals, 100 * num_measurements);
      EXPECT_NEAR(components[k].redundancy_share, share, 0.06)
          << num_measurements << " measurements, term " << k;
      // I - H is a projection here.
      EXPECT_NEAR(components[k].own_share, components[k].redundancy_share,
                  0.05);
    }
  }
}

// The linear step to other sigmas predicts an adjustment with them.
TEST(LinearAdjustment, ForeseesAnAdjustmentWithOtherSigmas) {
  const MapperWorld world = BuildDrive(1);
  colmap::Reconstruction model = Reconstruct(world);
  const PriorBundleAdjustmentProblem problem = ProblemOf(world, model);
  PriorBundleAdjustmentOptions options;
  options.function_tolerance = 1e-10;
  // Plain squares: robust weights would change with the step.
  options.prior_loss_scale = 1e3;
  options.reproj_loss_scale_px = 0.0;
  std::unique_ptr<ReducedSystem> system;
  ASSERT_TRUE(AdjustBundle(options, problem, &model, &system).success);
  LinearAdjustment linear(system.get(), options.prior_loss_scale);
  options.prior_sigma_factors = {0.5, 2.0, 0.3, 1.0, 1.0};
  PriorComponents foreseen;
  ASSERT_TRUE(linear.Solve(options.prior_sigma_factors, &foreseen));
  const PriorBundleAdjustmentSummary summary =
      AdjustBundle(options, problem, &model);
  ASSERT_TRUE(summary.success);
  const PriorComponents found = ComputePriorComponents(
      options.prior_sigma_factors,
      CorrectSharedErrors(options.shared_errors, summary.shared_errors,
                          problem.priors),
      model);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(foreseen[k].num_residuals, found[k].num_residuals);
    EXPECT_NEAR(foreseen[k].mean_square, found[k].mean_square,
                0.03 * found[k].mean_square)
        << "term " << k;
  }
}

TEST(PriorComponents, LeavesOutWhatSensorsDidNotMeasure) {
  const MapperWorld world = BuildDrive(1);
  const colmap::Reconstruction model = Reconstruct(world);
  std::vector<PosePriorEdge> priors = ProblemOf(world, model, 1.0).priors;
  const double chi2 = ComputePriorMeanSquare(priors, model);
  PosePriorEdge guess = priors.front();
  guess.dt_s = -1.0;
  guess.cam2_from_cam1.translation *= 10.0;
  for (int k = 0; k < 100; ++k) priors.push_back(guess);
  EXPECT_EQ(ComputePriorMeanSquare(priors, model), chi2);
}

// Poses fit correct priors, whose mean square is then below 1. The chi-square
// is divided by the redundancy even if the sigmas are not estimated.
TEST(AdjustBundleWithVarianceComponents, DividesByTheRedundancy) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    colmap::Reconstruction model = Reconstruct(world);
    const PriorBundleAdjustmentProblem problem = ProblemOf(world, model);
    VarianceComponentOptions balance;
    balance.estimate_prior_sigmas = false;
    double factor = 1.0;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundleWithVarianceComponents(balance, {}, problem, &model,
                                           &factor);
    const double mean_square = ComputePriorMeanSquare(
        CorrectSharedErrors({}, summary.shared_errors, problem.priors), model);
    EXPECT_LT(1.05 * mean_square, summary.prior_chi2_per_dof)
        << "seed " << seed;
    // 1 sigma of some 200 redundant residuals is 0.1; the largest of three
    // kinds is reported.
    EXPECT_NEAR(summary.prior_chi2_per_dof, 1.0, 0.4) << "seed " << seed;
  }
}

// Sigmas stated three times too large are estimated within 40 % of the truth,
// and the chi-square becomes 1. Correct sigmas stay.
TEST(AdjustBundleWithVarianceComponents, LowersSigmasThatResidualsRefute) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const MapperWorld world = BuildDrive(seed);
    const colmap::Reconstruction start = Reconstruct(world);
    const auto adjust = [&](double sigma_factor, bool estimates) {
      colmap::Reconstruction model = start;
      VarianceComponentOptions balance;
      balance.estimate_prior_sigmas = estimates;
      double factor = 1.0;
      return AdjustBundleWithVarianceComponents(
          balance, {}, ProblemOf(world, start, sigma_factor), &model, &factor);
    };
    const PriorBundleAdjustmentSummary large = adjust(3.0, true);
    const PriorBundleAdjustmentSummary kept = adjust(3.0, false);
    const PriorBundleAdjustmentSummary right = adjust(1.0, true);
    EXPECT_LT(kept.prior_chi2_per_dof, 0.3) << "seed " << seed;
    EXPECT_GT(large.prior_chi2_per_dof, 0.7) << "seed " << seed;
    EXPECT_LT(large.prior_chi2_per_dof, 1.3) << "seed " << seed;
    EXPECT_EQ(kept.prior_sigma_factors, kStatedPriorSigmas);
    for (const PriorTerm term : {PriorTerm::kRotation, PriorTerm::kDirection}) {
      const auto k = static_cast<size_t>(term);
      EXPECT_NEAR(large.prior_sigma_factors[k], 1.0 / 3.0, 0.13)
          << "seed " << seed << ", term " << k;
      EXPECT_GT(right.prior_sigma_factors[k], 0.7)
          << "seed " << seed << ", term " << k;
    }
  }
}

}  // namespace
}  // namespace adasfm
