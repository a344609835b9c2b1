// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "colmap_ext/host/colmap.h"
#include "core/camera_rig.h"
#include "core/sqlite.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// COLMAP 3.12 and later put images into frames of rigs. For a model without
// rigs.bin and frames.bin, these programs assume one rig per camera and one
// frame per image, with the same ids. Where the database has other rigs or
// frames, they abort when they use the model with the database, unless the two
// files contain the database's ids.

struct FrameOfImage {
  uint32_t frame_id = 0;
  uint32_t rig_id = 0;
};

// Content of a model's two files; without files `frames` is empty.
struct ModelFrames {
  // Of every image.
  std::map<image_t, FrameOfImage> frames;
  // Rigs of several cameras.
  CameraRigs rigs;
};

// The frames and rigs of the host's own tables, and whether there are such
// tables. `frames` is empty when a model needs no files. Throws SqliteError.
struct DatabaseFrames : ModelFrames {
  bool has_tables = false;
};
DatabaseFrames ReadDatabaseFrames(SqliteConnection* database);

// Writes rigs.bin and frames.bin for the registered images into a model's
// folder. The pose of a frame is that of its reference camera or, where that
// image is missing, of another camera through cam_from_rig. Cameras without a
// frame in the model from which cam_from_rig follows keep that of
// `frames.rigs`. False when an image has no frame or the files cannot be
// written.
bool WriteFrameFiles(const colmap::Reconstruction& model,
                     const ModelFrames& frames, const std::string& folder);

}  // namespace adasfm
