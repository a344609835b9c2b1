// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/priors/prior_importer.h"
#include "core/status.h"
#include "sensors/io/calibration.h"

namespace adasfm {

// What: reads the logs of an import and leaves their bad samples out.
// Inputs: paths (an empty one is no log) and the calibration, which says what
// the wheel log is. Warnings and faults are added to import.
// On failure: one line with file, line, cause and remedy.
Status ReadSensorLogs(const PriorImportPaths& paths,
                      const SensorCalibration& calibration, SensorLogs* logs,
                      PriorImport* import);

}  // namespace adasfm
