// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "colmap_ext/host/colmap.h"
#include "core/status.h"

namespace adasfm {

// A checkpoint is a folder: state.json, with the fingerprint of its inputs, and
// the three files of a COLMAP model with their sizes and digests. It gets its
// name when all of it is on the disk and has been read back, so that neither a
// kill, nor a power cut, nor a full disk leaves half of one.

// Replaces the checkpoint at `path`. Without a model only the state is written.
// The error names the cause, such as a full disk.
Status WriteModelCheckpoint(const std::string& path,
                            const std::string& fingerprint,
                            nlohmann::json state,
                            const colmap::Reconstruction* model);

// The state; an error when the folder is missing, of another fingerprint, or
// damaged: its files must be those that were written.
StatusOr<nlohmann::json> ReadCheckpointState(const std::string& path,
                                             const std::string& fingerprint);

// The model of a checkpoint whose state has been read; an error when it has
// none.
StatusOr<colmap::Reconstruction> ReadCheckpointModel(const std::string& path);

// The checkpoints of a mapper's run: plan.json and folders part_<k> and
// refine_<r> in one folder.

// An error when the folder, which need not exist, holds anything else.
Status CheckCheckpointFolder(const std::string& path);

// Removes all checkpoints; nothing where CheckCheckpointFolder fails.
Status RemoveCheckpoints(const std::string& path);

}  // namespace adasfm
