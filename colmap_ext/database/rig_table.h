// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "core/camera_rig.h"
#include "core/sqlite.h"

namespace adasfm {

// The table adasfm_rig_cameras (docs/reference/formats.md): the cameras of a
// rig from the import. Images of equal times form a frame, unless the database
// has the host's own frames.

// Replaces all rows; without cameras removes the table.
void WriteRigCameras(const std::map<camera_t, RigCamera>& cameras,
                     SqliteConnection* database);

// The rigs of a database. Where the host has rigs: these and their frames, with
// poses from adasfm_rig_cameras; else the rig of adasfm_rig_cameras. Images of
// rig cameras without a time or frame belong to no rig. Throws SqliteError for
// rows that WriteRigCameras could not have written.
CameraRigs ReadCameraRigs(SqliteConnection* database);

}  // namespace adasfm
