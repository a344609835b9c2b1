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

// COLMAP 3.12 and later put images into frames of rigs. A model without
// rigs.bin and frames.bin has a rig for every camera and a frame for every
// image, with the same ids; where the database has others, these programs end
// when they use both together, unless the two files say the database's ids.

struct FrameOfImage {
  uint32_t frame_id = 0;
  uint32_t rig_id = 0;
};

// What a model's two files say; no files where `frames` is empty.
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
// folder. The pose of a frame is that of its reference camera or, where that is
// missing, of another one through cam_from_rig; cameras whose cam_from_rig no
// frame of the model shows have that of the rigs. False when an image has no
// frame or the files cannot be written.
bool WriteFrameFiles(const colmap::Reconstruction& model,
                     const ModelFrames& frames, const std::string& folder);

}  // namespace adasfm
