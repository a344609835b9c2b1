// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/mapper_stage/checkpoint_file.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"
#include "core/types.h"
#include "partition/image_graph.h"
#include "partition/normalized_cut.h"

namespace adasfm {

struct PartitionPlanOptions {
  NormalizedCutOptions cut;
  // tau_ot of the flood fill; the paper's value.
  double min_overlap_ratio = 0.3;
  // Up to this many places (partition/places.h) the scene stays one part.
  int max_num_images_undivided = 200;

  bool IsValid(std::string* error) const;
};

// Which images each local reconstruction works on.
struct PartitionPlan {
  // With overlap; images sorted by id.
  std::vector<std::vector<image_t>> parts;
  // The share of each part's images that other parts have too.
  std::vector<double> overlap_ratios;
};

// The graph of matches (weight: inliers) and sensor priors over all images with
// a coarse pose or a match.
ImageGraph BuildImageGraph(const SceneData& data, const CoarsePoseMap& coarse);

PartitionPlan BuildPartitionPlan(const PartitionPlanOptions& options,
                                 const SceneData& data,
                                 const CoarsePoseMap& coarse);

// Writes JSON, with the fingerprint of what the plan was made from.
Status WritePartitionPlan(const std::string& path,
                          const std::string& fingerprint,
                          const PartitionPlan& plan);
// An error for a missing or damaged file and for another fingerprint;
// `condition`, unless null, says which.
StatusOr<PartitionPlan> ReadPartitionPlan(
    const std::string& path, const std::string& fingerprint,
    CheckpointCondition* condition = nullptr);

}  // namespace adasfm
