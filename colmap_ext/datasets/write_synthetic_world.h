// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

// COLMAP specialises vectors of Eigen's types; must precede code that uses
// them.
#include "colmap_ext/host/colmap.h"
#include "core/geodesy.h"
#include "core/status.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Writes the world as a COLMAP database at `path`: cameras with focal lengths
// marked as known, images, keypoints, raw matches and two-view geometries
// (CALIBRATED, with E and pose). An existing file is replaced when the new one
// is complete.
Status WriteSyntheticDatabase(const SyntheticWorld& world,
                              const std::string& path);

// Writes imu.csv, wheel.csv, times.csv, sensors.yaml, gt.txt and landmarks.txt
// to the folder, in the formats of the importer and the evaluator; with fixes
// also gnss.csv, where the world's origin is at kSyntheticWorldOrigin; and
// world.json with the true figures of the world.
inline constexpr GeodeticPosition kSyntheticWorldOrigin{48.98, 8.39, 115.0};
Status WriteSyntheticLogs(const SyntheticWorld& world,
                          const std::string& folder);

}  // namespace adasfm
