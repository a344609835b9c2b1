// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/mapper/local_mapper_scene.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "core/status.h"

namespace adasfm {

// Writes the merged model after a number of refinement rounds (0: none), with
// the summary's figures of alignment, merge and refinement, to the folder
// refine_<rounds> in checkpoint_path. Removes the folders of fewer rounds.
Status WriteMergeCheckpoint(const std::string& checkpoint_path,
                            const std::string& fingerprint, int num_rounds,
                            const MapperStageSummary& summary,
                            const MapperScene& scene);

struct MergeCheckpoint {
  int num_rounds = 0;
  colmap::Reconstruction model;
};

// Reads the checkpoint of most rounds, with the summary, and removes remnants
// of those of fewer rounds. An error without a sound one of this fingerprint;
// it names the problems of those that exist.
StatusOr<MergeCheckpoint> ReadMergeCheckpoint(
    const std::string& checkpoint_path, const std::string& fingerprint,
    MapperStageSummary* summary);

// Puts the model into the scene, none of whose images may be registered.
void PutIntoScene(const colmap::Reconstruction& model, MapperScene* scene);

}  // namespace adasfm
