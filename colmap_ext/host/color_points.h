// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Gives the points of the models output_path/0, 1, ... the colours of the
// photos below image_path, by COLMAP's own function, and writes their
// points3D.bin anew. What COLMAP prints, as for a photo that is gone, goes to
// the end of log_path.
Status ColorPoints(const std::string& image_path,
                   const std::string& output_path, const std::string& log_path);

}  // namespace adasfm
