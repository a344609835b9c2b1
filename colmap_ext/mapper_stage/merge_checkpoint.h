// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "core/status.h"

namespace adasfm {

// The merged model after a number of rounds of refinement, 0 for none, with
// what the summary says about alignment, merge and refinement: the folder
// refine_<rounds> in checkpoint_path. Those of fewer rounds are removed.
Status WriteMergeCheckpoint(const std::string& checkpoint_path,
                            const std::string& fingerprint, int num_rounds,
                            const MapperStageSummary& summary,
                            const MapperScene& scene);

struct MergeCheckpoint {
  int num_rounds = 0;
  colmap::Reconstruction model;
};

// Reads the checkpoint of most rounds, with the summary, and removes what is
// left of those of fewer. An error when there is none of this fingerprint that
// is sound; it says what is wrong with those that are there.
StatusOr<MergeCheckpoint> ReadMergeCheckpoint(
    const std::string& checkpoint_path, const std::string& fingerprint,
    MapperStageSummary* summary);

// Puts the model into the scene, none of whose images may be registered.
void PutIntoScene(const colmap::Reconstruction& model, MapperScene* scene);

}  // namespace adasfm
