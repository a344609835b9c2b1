// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/frames.h"
#include "core/status.h"

namespace adasfm {

// Writes a model's binary files into an existing folder, checks that they are
// complete, as COLMAP's reader requires, and waits until they are on the disk.
// COLMAP itself reports no failed write. The error names file and cause. With
// `frames` (frames.h), also writes rigs.bin and frames.bin.
Status WriteBinaryModel(const colmap::Reconstruction& model,
                        const std::string& path,
                        const ModelFrames& frames = {});

// Replaces points3D.bin in the folder of this model and keeps all other files.
Status ReplacePoints(const colmap::Reconstruction& model,
                     const std::string& path);

// Writes COLMAP models as output_path/0, output_path/1, ... in binary. All are
// complete under a temporary name before the first one appears. Models of an
// earlier run with higher numbers are removed; nothing else in the folder is
// touched. `frames` as above. An error when the disk is full or not writable,
// and in the cases of CheckModelFolders.
Status WriteModelFolder(
    const std::string& output_path,
    const std::vector<const colmap::Reconstruction*>& models,
    const ModelFrames& frames = {});

// An error when an entry of output_path with a number as its name is anything
// but a folder with only the files of a COLMAP model. Links are not followed.
Status CheckModelFolders(const std::string& output_path);

// An error when the folder, which need not exist, holds anything but the files
// of a COLMAP model and those named.
Status CheckModelFolder(const std::string& path,
                        const std::vector<std::string>& other_names = {});

// Removes a folder that CheckModelFolder accepts; otherwise removes nothing.
Status RemoveModelFolder(const std::string& path,
                         const std::vector<std::string>& other_names = {});

}  // namespace adasfm
