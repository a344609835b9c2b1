// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "core/position_prior.h"
#include "core/status.h"
#include "sensors/estimate_priors.h"
#include "sensors/io/calibration.h"

namespace adasfm {

struct PositionPriorOptions {
  // An image between two fixes further apart than this gets no position: the
  // path between the fixes is unknown.
  double max_fix_gap_s = 3.0;
  // Correlation time of the receiver's errors. Fixes at shorter intervals share
  // errors, so the variance of each is raised. 0: independent errors.
  double correlation_time_s = 0.0;

  bool IsValid(std::string* error) const;
};

struct PositionPriors {
  // In the ENU frame of the origin: first those between two images, then those
  // of single images, each in order of time.
  std::vector<PositionPrior> priors;
  GeodeticPosition origin;
  int num_fixes = 0;
  // Fixes before the first and after the last image.
  int num_fixes_outside = 0;
};

// Assigns fixes to images (ordered by time, on the camera's clock). A fix
// between two images at most 0.5 s apart is a position on the line between
// them. Where images are further apart, each of them gets a position on the
// line between the fixes around it. Error that names both time spans when no
// prior results.
StatusOr<PositionPriors> ComputePositionPriors(
    const PositionPriorOptions& options, const SensorCalibration& calibration,
    const std::vector<ImageStamp>& images, const std::vector<GnssFix>& fixes);

}  // namespace adasfm
