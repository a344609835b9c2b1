// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/minimize_bundle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "tests/testing/colmap_ext/bundle_world_problem.h"

namespace adasfm {
namespace {

ceres::Solver::Summary SolveWithCeres(const MinimizeBundleOptions& options,
                                      BundleProblem* bundle) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = kGradientAndStepTolerance;
  solver.parameter_tolerance = kGradientAndStepTolerance;
  solver.initial_trust_region_radius = options.initial_radius;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = bundle->Ordering();
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, bundle->CeresProblem(), &summary);
  return summary;
}

// The same adjustment with true priors, by Ceres and by MinimizeBundle.
struct Solutions {
  ceres::Solver::Summary expected;
  MinimizeBundleSummary summary;
  // By Ceres and by MinimizeBundle.
  colmap::Reconstruction models[2];
};

Solutions SolveBoth(const BundleWorldOptions& world,
                    const MinimizeBundleOptions& minimize,
                    double rotation_error_rad, double position_error_m) {
  Solutions solutions;
  for (colmap::Reconstruction& model : solutions.models) {
    model = BuildBundleWorld(world);
    PerturbBundleWorld(rotation_error_rad, position_error_m, world.seed,
                       &model);
  }
  PriorBundleAdjustmentProblem problem = ProblemOfAll(solutions.models[0]);
  problem.priors = TruePriors(world);
  const PriorBundleAdjustmentOptions options;
  BundleProblem listed(options, problem, solutions.models[0]);
  listed.FixFirstPose();
  solutions.expected = SolveWithCeres(minimize, &listed);
  BundleProblem apart(options, problem, solutions.models[1],
                      /*may_keep_points_apart=*/true);
  apart.FixFirstPose();
  EXPECT_EQ(apart.NumPointsApart(), listed.NumPoints());
  EXPECT_EQ(apart.NumResiduals(), listed.NumResiduals());
  solutions.summary = MinimizeBundle(minimize, &apart);
  EXPECT_TRUE(solutions.summary.success);
  EXPECT_NEAR(solutions.summary.initial_cost, solutions.expected.initial_cost,
              1e-10 * solutions.expected.initial_cost);
  listed.WriteTo(&solutions.models[0]);
  apart.WriteTo(&solutions.models[1]);
  return solutions;
}

MinimizeBundleOptions WithoutPointIterations(double initial_radius) {
  MinimizeBundleOptions options;
  options.initial_radius = initial_radius;
  options.max_num_point_iterations = 0;
  options.moves_inverse_distances = false;
  return options;
}

int NumIterations(const ceres::Solver::Summary& summary) {
  return summary.num_successful_steps + summary.num_unsuccessful_steps;
}

// The reprojection cost of a point of the model if it were at xyz, with the
// adjustment's Cauchy loss, in px^2.
double ReprojectionCostPx(const colmap::Reconstruction& model,
                          const colmap::Point3D& point,
                          const Eigen::Vector3d& xyz) {
  const double scale_px = PriorBundleAdjustmentOptions().reproj_loss_scale_px;
  double sum = 0.0;
  for (const auto& element : TrackOf(point).Elements()) {
    const colmap::Image& image = model.Image(element.image_id);
    const Eigen::Vector3d in_cam = CamFromWorld(image) * xyz;
    const double error_px =
        (PixelFromPlane(model.Camera(image.CameraId()), in_cam.hnormalized()) -
         XyOf(image.Point2D(element.point2D_idx)))
            .norm();
    sum += scale_px * scale_px * std::log1p(std::pow(error_px / scale_px, 2));
  }
  return sum;
}

// Whether cutting leaves single observations, which are not used.
bool HasSingles(const Covisibility& covisibility,
                const colmap::Point3D& point) {
  std::set<image_t> images;
  for (const auto& element : TrackOf(point).Elements()) {
    images.insert(element.image_id);
  }
  const std::vector<int> group_of =
      covisibility.CutTrack({images.begin(), images.end()});
  return std::any_of(group_of.begin(), group_of.end(), [&](int group) {
    return std::count(group_of.begin(), group_of.end(), group) == 1;
  });
}

// Cutting points where images share few of them hardly changes the poses, and
// the points converge to the minimum over all of their observations.
TEST(MinimizeBundleTest, PointsMayBeCutWhereImagesShareFew) {
  // A hundredth of the variance of a coordinate.
  constexpr double kTolerance = 0.01 * 0.5 * 0.5;
  for (const uint64_t seed : {1, 2, 3}) {
    BundleWorldOptions world;
    world.num_images = 100;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    colmap::Reconstruction whole = BuildBundleWorld(world);
    PerturbBundleWorld(2e-3, 0.05, seed, &whole);
    colmap::Reconstruction cut = whole;
    PriorBundleAdjustmentProblem problem = ProblemOfAll(whole);
    problem.priors = TruePriors(world);
    const Covisibility covisibility(problem.images, cut, 10);
    int num_blocks[2];
    for (const bool is_cut : {false, true}) {
      colmap::Reconstruction& model = is_cut ? cut : whole;
      BundleProblem bundle({}, problem, model, /*may_keep_points_apart=*/true,
                           is_cut ? &covisibility : nullptr);
      bundle.FixFirstPose();
      num_blocks[is_cut] = bundle.NumPoints();
      MinimizeBundleOptions minimize;
      minimize.function_tolerance = 1e-10;
      EXPECT_TRUE(MinimizeBundle(minimize, &bundle).success);
      bundle.WriteTo(&model);
    }
    EXPECT_GT(num_blocks[true], num_blocks[false]);
    double sum = 0.0;
    for (const image_t id : problem.images) {
      sum += (CamFromWorld(cut.Image(id)).TargetOriginInSource() -
              CamFromWorld(whole.Image(id)).TargetOriginInSource())
                 .squaredNorm();
    }
    // The difference is less than the error due to the keypoint noise.
    EXPECT_LT(std::sqrt(sum / problem.images.size()),
              CenterError(world, whole));
    for (const colmap::Reconstruction* model : {&whole, &cut}) {
      for (const auto& [id, point] : model->Points3D()) {
        if (HasSingles(covisibility, point)) continue;
        const auto cost = [&](const Eigen::Vector3d& xyz) {
          return ReprojectionCostPx(*model, point, xyz);
        };
        const double smallest = cost(XyzOf(point)) - kTolerance;
        for (int axis = 0; axis < 3; ++axis) {
          const Eigen::Vector3d step = 1e-3 * Eigen::Vector3d::Unit(axis);
          EXPECT_GT(cost(XyzOf(point) + step), smallest);
          EXPECT_GT(cost(XyzOf(point) - step), smallest);
        }
      }
    }
  }
}

// Starts near the minimum, and where steps are rejected. Both solvers are
// stopped before they converge.
TEST(MinimizeBundleTest, MakesTheStepsOfCeres) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  MinimizeBundleOptions minimize = WithoutPointIterations(1e7);
  minimize.function_tolerance = 0.0;
  for (const auto& [position_error_m, num_iterations] :
       {std::pair(0.05, 4), std::pair(2.0, 20)}) {
    SCOPED_TRACE(position_error_m);
    minimize.max_num_iterations = num_iterations;
    const Solutions solutions =
        SolveBoth(world, minimize, 2e-2, position_error_m);
    EXPECT_EQ(solutions.summary.num_iterations, num_iterations + 1);
    EXPECT_EQ(NumIterations(solutions.expected), num_iterations + 1);
    EXPECT_NEAR(solutions.summary.final_cost, solutions.expected.final_cost,
                1e-8 * solutions.expected.final_cost);
    const auto& [by_ceres, by_points] = solutions.models;
    for (const image_t id : by_ceres.RegImageIds()) {
      EXPECT_LT((by_points.Image(id).Tvec() - by_ceres.Image(id).Tvec()).norm(),
                1e-6);
    }
  }
}

// Converges where Ceres does, but without discarding the last step.
TEST(MinimizeBundleTest, KeepsItsLastStep) {
  BundleWorldOptions world;
  world.pixel_noise_px = 0.5;
  const MinimizeBundleOptions minimize = WithoutPointIterations(1e7);
  MinimizeBundleOptions fully = minimize;
  fully.function_tolerance = 1e-12;
  for (const double position_error_m : {0.05, 2.0}) {
    SCOPED_TRACE(position_error_m);
    const Solutions solutions =
        SolveBoth(world, minimize, 2e-2, position_error_m);
    EXPECT_EQ(solutions.summary.num_iterations,
              NumIterations(solutions.expected));
    EXPECT_LT(solutions.summary.final_cost, solutions.expected.final_cost);
    EXPECT_GT(
        solutions.summary.final_cost,
        (1.0 - minimize.function_tolerance) * solutions.expected.final_cost);
    const auto& [by_ceres, by_points] = solutions.models;
    const Solutions best = SolveBoth(world, fully, 2e-2, position_error_m);
    double distance = 0.0, distance_of_ceres = 0.0;
    for (const image_t id : by_ceres.RegImageIds()) {
      const auto& at_best = best.models[1].Image(id).Tvec();
      distance += (by_points.Image(id).Tvec() - at_best).squaredNorm();
      distance_of_ceres += (by_ceres.Image(id).Tvec() - at_best).squaredNorm();
    }
    EXPECT_LT(distance, distance_of_ceres);
  }
}

// The spacing is so small that images see most of each other's points: a
// factorisation takes longer than iterations with an earlier factor.
TEST(MinimizeBundleTest, ReusesAFactorThatTakesLong) {
  MinimizeBundleOptions minimize = WithoutPointIterations(1e10);
  minimize.function_tolerance = 1e-8;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    BundleWorldOptions world;
    world.num_images = 200;
    world.spacing_m = 0.3;
    world.pixel_noise_px = 0.5;
    world.seed = seed;
    const Solutions solutions = SolveBoth(world, minimize, 2e-3, 0.05);
    EXPECT_NEAR(solutions.summary.final_cost, solutions.expected.final_cost,
                1e-8 * solutions.expected.final_cost);
    EXPECT_EQ(solutions.summary.num_iterations,
              NumIterations(solutions.expected));
    EXPECT_LT(solutions.summary.num_factorizations,
              solutions.summary.num_iterations);
  }
}

// Exchanges two tracks in a third of the images that see both.
void ExchangeInPart(colmap::point3D_t id1, colmap::point3D_t id2,
                    colmap::Reconstruction* model) {
  std::map<image_t, colmap::TrackElement> of_first;
  for (const auto& element : TrackOf(model->Point3D(id1)).Elements()) {
    of_first.emplace(element.image_id, element);
  }
  std::vector<std::pair<colmap::TrackElement, colmap::TrackElement>> common;
  for (const auto& element : TrackOf(model->Point3D(id2)).Elements()) {
    const auto other = of_first.find(element.image_id);
    if (other != of_first.end()) common.emplace_back(other->second, element);
  }
  for (size_t k = 0; k < common.size() / 3; ++k) {
    const auto& [first, second] = common[k];
    model->DeleteObservation(first.image_id, first.point2D_idx);
    model->DeleteObservation(second.image_id, second.point2D_idx);
    model->AddObservation(id1, second);
    model->AddObservation(id2, first);
  }
}

// Spoils long tracks whose keypoints are near each other in an image.
void SpoilTracks(int num_pairs, colmap::Reconstruction* model) {
  constexpr size_t kMinLength = 6;
  constexpr double kMaxDistancePx = 20.0;
  const size_t num_spoilt = 2 * num_pairs;
  std::set<colmap::point3D_t> spoilt;
  for (const image_t image_id : model->RegImageIds()) {
    const colmap::Image& image = model->Image(image_id);
    std::vector<std::pair<Eigen::Vector2d, colmap::point3D_t>> seen;
    for (const auto& point2D : image.Points2D()) {
      if (!point2D.HasPoint3D()) continue;
      const colmap::point3D_t id = PointIdOf(point2D);
      if (spoilt.count(id) > 0) continue;
      if (TrackOf(model->Point3D(id)).Length() < kMinLength) continue;
      seen.emplace_back(XyOf(point2D), id);
    }
    for (size_t a = 0; a < seen.size(); ++a) {
      for (size_t b = a + 1; b < seen.size(); ++b) {
        const auto& [xy1, id1] = seen[a];
        const auto& [xy2, id2] = seen[b];
        if (spoilt.size() >= num_spoilt) return;
        if ((xy1 - xy2).norm() > kMaxDistancePx) continue;
        if (spoilt.count(id1) > 0 || spoilt.count(id2) > 0) continue;
        ExchangeInPart(id1, id2, model);
        spoilt.insert({id1, id2});
      }
    }
  }
  FAIL() << "fewer pairs than asked for";
}

MinimizeBundleSummary MinimizeSpoilt(uint64_t seed, int num_spoilt_pairs,
                                     int max_num_point_iterations) {
  BundleWorldOptions world;
  world.num_images = 60;
  world.pixel_noise_px = 0.5;
  world.seed = seed;
  colmap::Reconstruction model = BuildBundleWorld(world);
  SpoilTracks(num_spoilt_pairs, &model);
  PerturbBundleWorld(2e-3, 0.05, seed, &model);
  PriorBundleAdjustmentProblem problem = ProblemOfAll(model);
  problem.priors = TruePriors(world);
  BundleProblem bundle({}, problem, model, /*may_keep_points_apart=*/true);
  bundle.FixFirstPose();
  MinimizeBundleOptions minimize;
  minimize.initial_radius = 1e10;
  minimize.function_tolerance = 1e-8;
  minimize.max_num_point_iterations = max_num_point_iterations;
  const MinimizeBundleSummary summary = MinimizeBundle(minimize, &bundle);
  EXPECT_TRUE(summary.success);
  return summary;
}

// A few points whose observations contradict each other take many steps of
// their own. The adjustment itself takes as few iterations as without them, to
// the same minimum.
TEST(MinimizeBundleTest, ContradictedPointsDoNotHoldUpTheRest) {
  const int max_num_iterations =
      MinimizeBundleOptions().max_num_point_iterations;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const MinimizeBundleSummary clean =
        MinimizeSpoilt(seed, 0, max_num_iterations);
    const MinimizeBundleSummary together = MinimizeSpoilt(seed, 10, 0);
    const MinimizeBundleSummary alone =
        MinimizeSpoilt(seed, 10, max_num_iterations);
    EXPECT_LE(alone.num_iterations, clean.num_iterations + 1);
    EXPECT_LT(alone.num_iterations, together.num_iterations);
    EXPECT_NEAR(alone.final_cost, together.final_cost,
                1e-6 * together.final_cost);
  }
}

}  // namespace
}  // namespace adasfm
