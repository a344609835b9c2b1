// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "sensors/estimate_priors.h"

namespace adasfm {

// A recorded sequence in the formats of docs/reference/sensors.md, with its
// truth.
struct Dataset {
  SensorCalibration calibration;
  SensorLogs logs;
  std::vector<ImageStamp> images;  // ids 1, 2, ... in order of time
  std::map<image_t, Rigid3d> cams_from_world;
};

// False when the folder is absent (these recordings are not part of the
// project). Throws when it is there but cannot be read.
bool ReadDataset(const std::string& name, Dataset* dataset);

// By logs alone, with default options. Throws what an import would report.
PriorEstimate EstimateOrThrow(const Dataset& dataset);

// Errors of the chained priors over all trajectory segments of a length
// (KITTI's measure), relative to the length.
struct SegmentErrors {
  int num_segments = 0;
  double translation = 0.0;         // rms, share of the length
  double mean_translation = 0.0;    // mean, share of the length
  double rotation_deg_per_m = 0.0;  // rms
};
SegmentErrors ComputeSegmentErrors(const PriorEstimate& estimate,
                                   const Dataset& dataset, double length_m);

// Per-pair errors of the priors.
struct PairErrors {
  double rotation_rms_deg = 0.0;
  double translation_rms_m = 0.0;
  double length_ratio = 0.0;  // sum of prior lengths / sum of true lengths
  // Normalised squared errors per degree of freedom.
  double rotation_chi2 = 0.0;
  double translation_chi2 = 0.0;
  double chi2 = 0.0;
};
PairErrors ComputePairErrors(const PriorEstimate& estimate,
                             const std::map<image_t, Rigid3d>& cams_from_world);

}  // namespace adasfm
