// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include "core/parallel.h"
#include "global/estimate_coarse_poses.h"
#include "global/rotation_averaging/rotation_averaging.h"
#include "global/structure/match_refinement.h"
#include "global/structure/triangulate_tracks.h"
#include "global/translation_averaging/translation_averaging.h"
#include "global/two_view/refine_relative_poses.h"
#include "global/view_graph/tracks.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {
namespace {

struct Input {
  ViewGraph graph;
  GlobalCorrespondences correspondences;
  std::vector<RelativePosePrior> priors;
  std::map<image_t, Rigid3d> cams_from_world;
};

Input BuildInput(int num_images) {
  SyntheticWorldOptions options;
  options.num_images = num_images;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  Input input;
  for (size_t k = 0; k < world.images.size(); ++k) {
    const SyntheticImage& image = world.images[k];
    input.graph.images.push_back(image.image_id);
    input.cams_from_world[image.image_id] = image.cam_from_world;
    input.correspondences.bearings[image.image_id] =
        ComputeBearings(world.camera, image);
    if (k == 0) continue;
    RelativePosePrior prior;
    prior.image_id1 = world.images[k - 1].image_id;
    prior.image_id2 = image.image_id;
    prior.dt_ns = image.timestamp_ns - world.images[k - 1].timestamp_ns;
    prior.cam2_from_cam1 = ComputeCam2FromCam1(
        world.images[k - 1].cam_from_world, image.cam_from_world);
    prior.covariance = 1e-4 * prior.covariance;
    prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
    input.priors.push_back(prior);
  }
  for (const SyntheticPair& pair : world.pairs) {
    ViewGraphEdge edge;
    edge.image_id1 = pair.image_id1;
    edge.image_id2 = pair.image_id2;
    edge.cam2_from_cam1 = pair.cam2_from_cam1;
    edge.num_inliers = pair.inlier_matches.size();
    input.graph.edges.push_back(edge);
    input.correspondences.matches[edge.Pair()] = pair.inlier_matches;
  }
  return input;
}

// Images of a town; with sensors (second argument 1) or without.
void BM_EstimateCoarsePoses(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  const std::vector<RelativePosePrior> priors =
      state.range(1) ? input.priors : std::vector<RelativePosePrior>();
  for (auto _ : state) {
    benchmark::DoNotOptimize(EstimateCoarsePoses(
        CoarsePoseOptions(), input.graph, input.correspondences, priors));
  }
  state.SetComplexityN(state.range(0));
}
BENCHMARK(BM_EstimateCoarsePoses)
    ->ArgsProduct({{250, 500, 1000}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

// As in the coarse stage.
constexpr int kMaxTrackLength = 12;

void BM_BuildTracks(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(SelectTracks(
        kMaxTrackLength, BuildTracks(input.correspondences.matches)));
  }
}
BENCHMARK(BM_BuildTracks)->Arg(500)->Unit(benchmark::kMillisecond);

void BM_RefineMatches(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(RefineMatches(
        MatchRefinementOptions(), input.cams_from_world,
        input.correspondences.bearings, input.correspondences.matches));
  }
}
BENCHMARK(BM_RefineMatches)->Arg(500)->Unit(benchmark::kMillisecond);

// Two-view poses with known rotations, as the coarse stage refines them.
void BM_RefineRelativePoses(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  const std::vector<std::optional<RotationPrediction>> predictions(
      input.graph.edges.size());
  for (auto _ : state) {
    ViewGraph graph = input.graph;
    RefineRelativePoses(RelativePoseRefinementOptions(), input.correspondences,
                        predictions, &graph);
    benchmark::DoNotOptimize(graph);
  }
  state.counters["pairs/s"] =
      benchmark::Counter(input.graph.edges.size() * state.iterations(),
                         benchmark::Counter::kIsRate);
}
BENCHMARK(BM_RefineRelativePoses)
    ->Arg(500)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

// Started by the semidefinite program (second argument 1) or a spanning tree.
void BM_EstimateGlobalRotations(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  RotationAveragingOptions options;
  options.use_sdp_start = state.range(1) != 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(EstimateGlobalRotations(options, input.graph));
  }
  state.SetComplexityN(state.range(0));
}
BENCHMARK(BM_EstimateGlobalRotations)
    ->ArgsProduct({{500, 1000, 2000}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

void BM_EstimateGlobalPositions(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  std::map<image_t, Eigen::Quaterniond> rotations;
  for (const auto& [image_id, pose] : input.cams_from_world) {
    rotations[image_id] = pose.rotation;
  }
  const std::vector<std::optional<EdgeLength>> lengths(
      input.graph.edges.size());
  for (auto _ : state) {
    benchmark::DoNotOptimize(EstimateGlobalPositions(
        TranslationAveragingOptions(), input.graph, rotations, lengths, {}));
  }
  state.SetComplexityN(state.range(0));
}
BENCHMARK(BM_EstimateGlobalPositions)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Unit(benchmark::kMillisecond);

void BM_TriangulateTracks(benchmark::State& state) {
  const Input input = BuildInput(state.range(0));
  const std::vector<Track> tracks =
      SelectTracks(kMaxTrackLength, BuildTracks(input.correspondences.matches));
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        TriangulateTracks(TrackTriangulationOptions(), input.cams_from_world,
                          input.correspondences.bearings, tracks));
  }
  state.counters["tracks"] = tracks.size();
}
BENCHMARK(BM_TriangulateTracks)
    ->Arg(500)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace adasfm
