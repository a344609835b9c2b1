// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>
#include <optim/bundle_adjustment.h>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "tests/testing/colmap_ext/bundle_world.h"

// Bundle adjustment of a street of state.range(0) images with 300 keypoints
// each: wall time per solver iteration, ours and COLMAP's (same poses, points
// and loss, intrinsics fixed).

namespace adasfm {
namespace {

constexpr int kNumIterations = 10;

colmap::Reconstruction NoisyWorld(int num_images) {
  BundleWorldOptions options;
  options.num_images = num_images;
  options.num_keypoints_per_image = 300;
  options.pixel_noise_px = 0.5;
  colmap::Reconstruction reconstruction = BuildBundleWorld(options);
  PerturbBundleWorld(1e-3, 0.05, 1, &reconstruction);
  return reconstruction;
}

void BM_AdjustBundle(benchmark::State& state) {
  const colmap::Reconstruction noisy = NoisyWorld(state.range(0));
  PriorBundleAdjustmentProblem problem;
  for (const image_t id : noisy.RegImageIds()) problem.images.insert(id);
  PriorBundleAdjustmentOptions options;
  options.max_num_iterations = kNumIterations;
  options.function_tolerance = 0.0;
  options.num_threads = -1;  // as COLMAP
  int num_iterations = 0;
  for (auto _ : state) {
    colmap::Reconstruction reconstruction = noisy;
    const PriorBundleAdjustmentSummary summary =
        AdjustBundle(options, problem, &reconstruction);
    num_iterations += summary.num_iterations;
    state.SetIterationTime(summary.seconds);
    state.counters["residuals"] = summary.num_residuals;
    state.counters["cost"] = summary.final_cost;
  }
  state.counters["iterations"] = num_iterations / state.iterations();
  state.counters["iterations/s"] =
      benchmark::Counter(num_iterations, benchmark::Counter::kIsRate);
}
BENCHMARK(BM_AdjustBundle)
    ->Arg(100)
    ->Arg(500)
    ->Arg(1000)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

void BM_ColmapBundleAdjuster(benchmark::State& state) {
  const colmap::Reconstruction noisy = NoisyWorld(state.range(0));
  colmap::BundleAdjustmentConfig config;
  for (const image_t id : noisy.RegImageIds()) config.AddImage(id);
  config.SetConstantPose(1);
  config.SetConstantTvec(state.range(0), {0});
  config.SetConstantCamera(1);
  colmap::BundleAdjustmentOptions options;
  options.loss_function_type =
      colmap::BundleAdjustmentOptions::LossFunctionType::SOFT_L1;
  options.loss_function_scale = 2.0;
  options.print_summary = false;
  options.solver_options.max_num_iterations = kNumIterations;
  int num_iterations = 0;
  for (auto _ : state) {
    colmap::Reconstruction reconstruction = noisy;
    colmap::BundleAdjuster adjuster(options, config);
    adjuster.Solve(&reconstruction);
    const ceres::Solver::Summary& summary = adjuster.Summary();
    num_iterations +=
        summary.num_successful_steps + summary.num_unsuccessful_steps;
    state.SetIterationTime(summary.total_time_in_seconds);
    state.counters["residuals"] = summary.num_residuals;
    state.counters["cost"] = summary.final_cost;
  }
  state.counters["iterations"] = num_iterations / state.iterations();
  state.counters["iterations/s"] =
      benchmark::Counter(num_iterations, benchmark::Counter::kIsRate);
}
BENCHMARK(BM_ColmapBundleAdjuster)
    ->Arg(100)
    ->Arg(500)
    ->Arg(1000)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace adasfm
