// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace adasfm {

// The forms that COLMAP's database has had since 3.6, in the order of their
// versions; the last one has other ids of frames than of images, as after
// rig_configurator.
const std::vector<std::string>& DatabaseForms();

// Gives a database of COLMAP 3.8 the form of another version: its tables and
// columns, its encoding of missing poses and matrices (all poses of two-view
// geometries become missing), and its user_version. Throws SqliteError.
void ReshapeDatabase(const std::string& path, const std::string& form);

// Makes cameras 1 and 2 of a database of COLMAP 3.12 or later the rig of
// rig_configurator: images k and k + num_frames become one frame.
// sensor_from_rig is camera 2's pose as COLMAP writes it; empty when unknown.
void MakeStereoRig(const std::string& path, int num_frames,
                   const std::string& sensor_from_rig);

// Changes an older file as COLMAP 4.2 does on opening: adds missing columns and
// tables, and writes NULL for poses and matrices that mean "none".
void MigrateToColmap4(const std::string& path);

}  // namespace adasfm
