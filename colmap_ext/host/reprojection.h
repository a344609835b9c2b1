// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/host/colmap.h"

namespace adasfm {

// The host's error of a point [px]: the mean over its observations.
double ComputeReprojectionError(const colmap::Reconstruction& reconstruction,
                                const colmap::Point3D& point);

}  // namespace adasfm
