// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "core/status.h"
#include "core/types.h"
#include "sensors/io/bag_logs.h"

namespace adasfm {

// Options of which photos of a bag are extracted.
struct PhotoSelectionOptions {
  // Extracts every image_step-th photo. Cameras record far more than a model
  // needs, but the number needed depends on the speed.
  int image_step = 1;
  // Of these, skips photos until the machine has moved this far [m], or turned
  // by 10 degrees, since the last extracted photo; needs wheels. 0: skips none.
  double image_distance_m = 0.0;

  bool IsValid(std::string* error) const;
};

// The stamps of the photos to extract; an error when a distance is required and
// the wheels do not measure it.
StatusOr<std::set<timestamp_t>> SelectPhotos(
    const BagLogs& logs, const PhotoSelectionOptions& options);

}  // namespace adasfm
