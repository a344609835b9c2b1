// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <base/reconstruction.h>

#include <cstdint>
#include <map>
#include <string>

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

struct DatabaseFrames {
  // Of every image; empty when a model needs no files of frames.
  std::map<image_t, FrameOfImage> frames;
  // Some rig has several cameras, whose relative poses are not kept: `frames`
  // is empty.
  bool has_camera_rigs = false;
};

// Of a database without frames: the default. An error for a file that cannot be
// read.
StatusOr<DatabaseFrames> ReadDatabaseFrames(const std::string& database_path);

// Writes rigs.bin and frames.bin for the registered images into a model's
// folder. False when an image has no frame or the files cannot be written.
bool WriteFrameFiles(const colmap::Reconstruction& model,
                     const std::map<image_t, FrameOfImage>& frames,
                     const std::string& folder);

inline constexpr char kCameraRigsWarning[] =
    "the database has rigs of several cameras; every image is placed on its "
    "own, and the model does not say its rigs to COLMAP 3.12 and later";

}  // namespace adasfm
