// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/reconstruction.h>

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/status.h"

namespace adasfm {

// A checkpoint is a folder: state.json, which says what it was made from, and
// the three files of a COLMAP model. It appears under its name when all of it
// is on the disk, so that neither a kill nor a power cut leaves half of one.

// Replaces the checkpoint at `path`. Without a model only the state is written.
Status WriteModelCheckpoint(const std::string& path,
                            const std::string& fingerprint,
                            nlohmann::json state,
                            const colmap::Reconstruction* model);

// The state; an error when the folder is missing, damaged or of another
// fingerprint.
StatusOr<nlohmann::json> ReadCheckpointState(const std::string& path,
                                             const std::string& fingerprint);

// Whether the model's files are there.
bool HasCheckpointModel(const std::string& path);
void ReadCheckpointModel(const std::string& path,
                         colmap::Reconstruction* model);

}  // namespace adasfm
