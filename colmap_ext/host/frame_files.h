// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/host/frames.h"
#include "core/status.h"

namespace adasfm {

// What rigs.bin and frames.bin in a model's folder say (frames.h), to write the
// model elsewhere; `frames` is empty where the folder has not both, or other
// sensors than cameras. Of the rigs the cameras, not their images. An error for
// a file that is cut short.
StatusOr<ModelFrames> ReadFrameFiles(const std::string& folder);

}  // namespace adasfm
