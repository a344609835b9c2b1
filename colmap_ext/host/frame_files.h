// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/host/frames.h"
#include "core/status.h"

namespace adasfm {

// Reads rigs.bin and frames.bin in a model's folder (frames.h), so that the
// model can be written elsewhere. `frames` is empty where one of the files is
// missing or lists sensors other than cameras. `rigs` gets cameras only, no
// images. An error for a file that is cut short.
StatusOr<ModelFrames> ReadFrameFiles(const std::string& folder);

}  // namespace adasfm
