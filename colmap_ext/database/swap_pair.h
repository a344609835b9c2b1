// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "core/sqlite.h"

namespace adasfm {

// A row of matches or two_view_geometries by its columns, with the two images
// of the pair exchanged: columns of the matches, F and E transposed, H and pose
// inverted, camera1 and camera2 exchanged. Missing values (NULL, zeros) stay
// missing. Throws SqliteError for blobs of wrong sizes.
void SwapPair(std::map<std::string, SqliteValue>* row);

}  // namespace adasfm
