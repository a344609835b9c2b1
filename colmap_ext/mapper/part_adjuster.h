// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <set>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/mapper/local_mapper.h"
#include "colmap_ext/mapper/local_mapper_scene.h"

namespace adasfm {

// The priors among the images, as terms of an adjustment.
std::vector<PosePriorEdge> FindPriorEdges(
    const std::vector<RelativePosePrior>& priors,
    const std::set<image_t>& images);

// The motion from the first to the second image in the coarse model, as weak
// terms of rotation and, unless it is too short, direction. None where the
// coarse model lacks one of the images.
std::optional<PosePriorEdge> CoarseEdge(const MapperScene& scene,
                                        image_t image_id1, image_t image_id2);

// The coarse edges of all pairs of the augmented view graph among the images:
// pairs with matches or with a prior.
std::vector<PosePriorEdge> FindCoarseEdges(const MapperScene& scene,
                                           const std::set<image_t>& images);

// The bundle adjustments of a growing part, with priors, each followed by a
// filter of points. The weight of vision against the priors is kept from one to
// the next. The arguments must outlive the adjuster.
class PartAdjuster {
 public:
  PartAdjuster(const LocalMapperOptions& options, MapperScene* scene);

  // The first two images.
  void AdjustPair(image_t image_id1, image_t image_id2);
  // The batch. Held fixed are the registered images that share most matches
  // with it, and those that its points need for their depth.
  void AdjustBatch(const std::set<image_t>& batch);
  // All registered images, after joining tracks.
  void AdjustAll(int max_num_iterations);

  // Calls of AdjustAll.
  int NumGlobalAdjustments() const { return num_global_adjustments_; }
  double KeypointSigmaFactor() const { return keypoint_sigma_factor_; }

 private:
  std::set<image_t> FindConstantImages(const std::set<image_t>& batch) const;
  void AddBaselines(const std::set<image_t>& batch,
                    std::set<image_t>* constant_images) const;
  void AdjustImages(const std::set<image_t>& images,
                    const std::set<image_t>& constant_images,
                    int max_num_iterations);
  void Filter(const std::set<image_t>& images);

  const LocalMapperOptions& options_;
  MapperScene& scene_;
  colmap::Reconstruction& reconstruction_;
  double keypoint_sigma_factor_ = 1.0;
  // Set by the last adjustment of all images.
  double max_reproj_error_px_ = 0.0;
  int num_global_adjustments_ = 0;
};

}  // namespace adasfm
