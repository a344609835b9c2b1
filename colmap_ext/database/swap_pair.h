// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "core/sqlite.h"

namespace adasfm {

// Exchanges the two images of a pair in a row of matches or
// two_view_geometries: swaps the columns of the matches, transposes F and E,
// inverts H and the pose, and swaps camera1 and camera2. Missing values (NULL,
// zeros) stay missing. Throws SqliteError for blobs of wrong sizes.
void SwapPair(std::map<std::string, SqliteValue>* row);

}  // namespace adasfm
