// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "colmap_ext/priors/prior_importer.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// Value of PriorImportPaths::gnss_path for positions stored in the database.
inline constexpr char kStoredPositionsPath[] = "database";

// Adds the positions of the log, or of the database, to the import's tables,
// and counts of skipped positions to its figures; does nothing without a path.
// Geodetic positions are transformed into the ENU frame of the first one. An
// error for an unusable log and for a database without positions.
Status ImportPositions(const PriorImportPaths& paths,
                       const PositionPriorOptions& options,
                       const SensorCalibration& calibration,
                       const SceneData& scene,
                       const std::vector<ImageStamp>& stamps,
                       PriorImport* import);

}  // namespace adasfm
