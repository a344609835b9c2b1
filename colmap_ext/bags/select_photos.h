// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "core/status.h"
#include "core/types.h"
#include "sensors/io/bag_logs.h"

namespace adasfm {

// Which photos of a bag are taken out.
struct PhotoSelectionOptions {
  // Every so many. Cameras record far more than a model needs; but what is
  // enough depends on the speed.
  int image_step = 1;
  // Not before the machine has moved so far, in metres, or has turned by 10
  // degrees since the last photo taken; needs wheels. 0: all of the above.
  double image_distance_m = 0.0;

  bool IsValid(std::string* error) const;
};

// The stamps of the photos to take; an error when the distance is asked for and
// the wheels do not tell it.
StatusOr<std::set<timestamp_t>> SelectPhotos(
    const BagLogs& logs, const PhotoSelectionOptions& options);

}  // namespace adasfm
