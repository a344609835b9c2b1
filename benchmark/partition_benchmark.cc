// SPDX-License-Identifier: BSD-3-Clause
#include <benchmark/benchmark.h>

#include "core/random.h"
#include "core/so3.h"
#include "partition/align_similarity.h"

namespace adasfm {
namespace {

// Poses of a part in its own frame and in the merged one, a fifth of them
// outliers.
std::vector<PosePair> MakePosePairs(int num_poses) {
  Random random(1);
  std::vector<PosePair> poses;
  for (int i = 0; i < num_poses; ++i) {
    PosePair pair;
    pair.cam_from_source = CamFromWorldWithCenter(
        ExpSo3(random.GaussianVector(1.0)), random.GaussianVector(20.0));
    const double sigma_m = i % 5 == 0 ? 10.0 : 0.05;
    pair.cam_from_target =
        CamFromWorldWithCenter(pair.cam_from_source.rotation,
                               pair.cam_from_source.TargetOriginInSource() +
                                   random.GaussianVector(sigma_m));
    poses.push_back(pair);
  }
  return poses;
}

void BM_AlignSimilarity(benchmark::State& state) {
  const std::vector<PosePair> poses = MakePosePairs(state.range(0));
  for (auto _ : state) {
    benchmark::DoNotOptimize(AlignSimilarity(AlignSimilarityOptions(), poses));
  }
}
BENCHMARK(BM_AlignSimilarity)->Arg(50)->Arg(500)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace adasfm
