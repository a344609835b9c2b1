// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace adasfm {

// The forms that COLMAP's database has had since 3.6, in the order of their
// versions; the last one has other ids of frames than of images, as after
// rig_configurator.
const std::vector<std::string>& DatabaseForms();

// Gives a database that COLMAP 3.8 made the form of another version: its tables
// and columns, its way to write poses and matrices that are missing (which all
// poses of two-view geometries become), and its user_version. Throws
// SqliteError.
void ReshapeDatabase(const std::string& path, const std::string& form);

}  // namespace adasfm
