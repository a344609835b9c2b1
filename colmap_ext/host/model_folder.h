// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/frames.h"
#include "core/status.h"

namespace adasfm {

// Writes a model's binary files into a folder that exists, reads them back as
// far as COLMAP's reader needs them sound, and waits until they are on the
// disk. COLMAP itself reports no failed write. The error names file and cause.
// With `frames` (frames.h), rigs.bin and frames.bin too.
Status WriteBinaryModel(const colmap::Reconstruction& model,
                        const std::string& path,
                        const ModelFrames& frames = {});

// Replaces points3D.bin in the folder of this model; what else is there stays.
Status ReplacePoints(const colmap::Reconstruction& model,
                     const std::string& path);

// Writes COLMAP models as output_path/0, output_path/1, ... in binary. All are
// complete under a temporary name before the first of them appears; numbered
// models that an earlier run left beyond the last one are removed, and nothing
// else in the folder is touched. `frames` as above. An error when the disk is
// full or not writable, and as CheckModelFolders.
Status WriteModelFolder(
    const std::string& output_path,
    const std::vector<const colmap::Reconstruction*>& models,
    const ModelFrames& frames = {});

// An error when something at output_path/0, 1, ... is no folder of a COLMAP
// model and nothing else: it would be in the way. Links are not followed.
Status CheckModelFolders(const std::string& output_path);

// An error when the folder, which need not exist, holds anything but the files
// of a COLMAP model and those named.
Status CheckModelFolder(const std::string& path,
                        const std::vector<std::string>& other_names = {});

// Removes what CheckModelFolder allows; where there is more, nothing.
Status RemoveModelFolder(const std::string& path,
                         const std::vector<std::string>& other_names = {});

}  // namespace adasfm
