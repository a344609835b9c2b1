// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/priors/prior_importer.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// As PriorImportPaths::gnss_path: the positions that COLMAP keeps with photos.
inline constexpr char kStoredPositionsPath[] = "database";

// Adds the positions of the log, or of the database, to the import's tables,
// and what was left out to its figures; nothing without a path. Geodetic ones
// are turned into the ENU frame of the first. An error for a log that cannot be
// used and for a database without positions.
Status ImportPositions(const PriorImportPaths& paths,
                       const PositionPriorOptions& options,
                       const SensorCalibration& calibration,
                       const SceneData& scene,
                       const std::vector<ImageStamp>& stamps,
                       PriorImport* import);

}  // namespace adasfm
