// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/priors/prior_importer.h"
#include "core/status.h"
#include "sensors/io/calibration.h"

namespace adasfm {

// Reads the logs of an import and removes their bad samples. Inputs: paths (an
// empty path is no log) and the calibration, which gives the type of the wheel
// log. Adds warnings and faults to `import`. On failure: one line with file,
// line, cause and remedy.
Status ReadSensorLogs(const PriorImportPaths& paths,
                      const SensorCalibration& calibration, SensorLogs* logs,
                      PriorImport* import);

}  // namespace adasfm
