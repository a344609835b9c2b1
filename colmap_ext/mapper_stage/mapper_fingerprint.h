// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/mapper/local_mapper.h"
#include "colmap_ext/mapper/refine_model.h"
#include "colmap_ext/mapper_stage/part_checkpoint.h"
#include "colmap_ext/mapper_stage/partition_plan.h"
#include "colmap_ext/scene/scene_data.h"
#include "partition/align_similarity.h"

namespace adasfm {

// Hashes of the options and data that a checkpoint depends on, so that results
// of other options or another database are noticed and not mixed. The number of
// threads is not included.

// Fingerprint of plan and parts.
std::string ComputePartsFingerprint(const PartitionPlanOptions& partition,
                                    const LocalMapperOptions& local,
                                    const SceneData& data,
                                    const CoarsePoseMap& coarse);

// Fingerprint of the merged model and its refinement: includes which parts
// there are, and their figures.
std::string ComputeMergeFingerprint(const std::string& parts_fingerprint,
                                    const AlignSimilarityOptions& align,
                                    const RefineModelOptions& refine,
                                    const std::vector<PartReport>& parts);

}  // namespace adasfm
