// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/reconstruction.h>

#include <map>
#include <string>
#include <vector>

#include "colmap_ext/host/frames.h"
#include "core/status.h"

namespace adasfm {

// Writes COLMAP models as output_path/0, output_path/1, ... in binary. All are
// complete under a temporary name before the first of them appears; numbered
// models that an earlier run left beyond the last one are removed, and nothing
// else in the folder is touched. With `frames` (frames.h), rigs.bin and
// frames.bin too. An error when the disk is full or not writable.
Status WriteModelFolder(
    const std::string& output_path,
    const std::vector<const colmap::Reconstruction*>& models,
    const std::map<image_t, FrameOfImage>& frames = {});

}  // namespace adasfm
