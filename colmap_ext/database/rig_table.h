// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "core/camera_rig.h"
#include "core/sqlite.h"

namespace adasfm {

// The table adasfm_rig_cameras (docs/reference/formats.md): the cameras of a
// rig as the import knows them. Frames are told by the images' times or, where
// the database has some, by the host's own frames.

// Replaces all rows; none of them removes the table.
void WriteRigCameras(const std::map<camera_t, RigCamera>& cameras,
                     SqliteConnection* database);

// The rigs of a database: ours, else the host's own, else none. Images of rig
// cameras without a time or frame belong to no rig. Throws SqliteError for rows
// that WriteRigCameras could not have written.
CameraRigs ReadCameraRigs(SqliteConnection* database);

}  // namespace adasfm
