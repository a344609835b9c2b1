// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Colours the points of the models output_path/0, 1, ... from the photos below
// image_path, by COLMAP's own function, and rewrites their points3D.bin.
// Messages that COLMAP prints, for example about a missing photo, are appended
// to log_path.
Status ColorPoints(const std::string& image_path,
                   const std::string& output_path, const std::string& log_path);

}  // namespace adasfm
