// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/factor_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <unordered_set>
#include <utility>
#include <vector>

#include "core/release_memory.h"
#include "core/sparse/block_ordering.h"

namespace adasfm {
namespace {

// If the factor has more blocks (1.2 GB), a point becomes one for each group of
// its images of which any two share three points. Where sensors measured the
// motions, any two share 24 unless no third image connects them. The other
// pairs that see points together constrain each other little, but take much of
// the memory and time (docs/reference/math.md). Without the motions a long
// drive bends and changes its scale less, the longer its tracks are. Where
// memory is bounded, the first number doubles, up to the last one.
constexpr size_t kMaxNumBlocksWhole = 4000000;
constexpr int kMinNumSharedPoints = 3;
constexpr int kMinNumSharedIfRedundant = 24;
constexpr int kMaxMinNumSharedPoints = 48;
// Measured on 30,000 images: a block of the equations with its row indices, a
// block of the factor, and an observation with its share of its point.
constexpr double kBytesPerBlock = 440.0;
constexpr double kBytesPerFactorBlock = 380.0;
constexpr double kBytesPerObservation = 100.0;

// The reduced camera system. Priors need no more blocks: the images that they
// tie see common points anyway.
struct SystemSize {
  explicit SystemSize(const Covisibility& covisibility)
      : num_factor_blocks(BoundNumFactorBlocks(covisibility.Neighbors())) {
    for (const std::vector<int>& neighbors : covisibility.Neighbors()) {
      num_blocks += 1 + neighbors.size();
    }
  }

  double Bytes() const {
    return kBytesPerBlock * num_blocks +
           kBytesPerFactorBlock * num_factor_blocks;
  }

  size_t num_blocks = 0;
  size_t num_factor_blocks = 0;
};

// The memory that the process may still take, without that of the points.
double MaxSystemBytes(double max_memory_gb, const std::set<image_t>& images,
                      const colmap::Reconstruction& reconstruction) {
  if (max_memory_gb < 0.0) return std::numeric_limits<double>::infinity();
  ReleaseFreedMemory(0.0);
  double num_observations = 0.0;
  for (const image_t image_id : images) {
    num_observations += reconstruction.Image(image_id).NumPoints3D();
  }
  return 1e9 * max_memory_gb - ResidentMemoryBytes() -
         kBytesPerObservation * num_observations;
}

}  // namespace

bool DoSensorsTieImages(const std::vector<PosePriorEdge>& priors,
                        const std::set<image_t>& images) {
  std::unordered_set<image_t> tied;
  for (const PosePriorEdge& prior : priors) {
    const bool has_length =
        prior.is_length_measured &&
        std::min(prior.length_sigma_m, prior.translation_sigma_m) <
            std::numeric_limits<double>::infinity();
    if (prior.dt_s < 0.0 || !has_length ||
        !std::isfinite(prior.rotation_sigma_rad)) {
      continue;
    }
    tied.insert({prior.image_id1, prior.image_id2});
  }
  constexpr double kMaxShareUntied = 0.01;
  const auto num_untied = std::count_if(
      images.begin(), images.end(),
      [&](image_t image_id) { return tied.count(image_id) == 0; });
  return num_untied <= kMaxShareUntied * images.size();
}

FactorPlan PlanFactor(const PriorBundleAdjustmentProblem& problem,
                      const colmap::Reconstruction& reconstruction,
                      int max_num_images_sparse, double max_memory_gb) {
  const std::set<image_t>& images = problem.images;
  FactorPlan plan;
  const size_t max_num_images = max_num_images_sparse;
  if (images.size() <= max_num_images && max_memory_gb < 0.0) return plan;
  const double max_bytes =
      MaxSystemBytes(max_memory_gb, images, reconstruction);
  Covisibility covisibility(images, reconstruction);
  SystemSize size(covisibility);
  if (size.num_factor_blocks > kMaxNumBlocksWhole || size.Bytes() > max_bytes) {
    if (DoSensorsTieImages(problem.priors, images)) {
      covisibility.CutRedundant(kMinNumSharedIfRedundant);
    }
    for (int min_num_shared = kMinNumSharedPoints;; min_num_shared *= 2) {
      plan.min_num_shared_points = min_num_shared;
      covisibility.Cut(min_num_shared);
      size = SystemSize(covisibility);
      if (size.Bytes() <= max_bytes) break;
      if (min_num_shared >= kMaxMinNumSharedPoints) break;
    }
    plan.cut = std::move(covisibility);
  }
  plan.is_small =
      size.num_factor_blocks <= max_num_images * (max_num_images - 1) / 2;
  return plan;
}

}  // namespace adasfm
