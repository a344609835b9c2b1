// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/matching/motion_prediction.h"
#include "core/status.h"

namespace adasfm {

// Predicts the motion between images by the chain of relative pose priors in
// the database (global/odometry/odometry_chain.h), including all errors that
// the steps share. None for images that no chain with rotation and length
// connects. An empty predictor without priors; an error for priors that cannot
// be read.
StatusOr<MotionPredictor> ReadMotionPredictor(const std::string& database_path);

}  // namespace adasfm
