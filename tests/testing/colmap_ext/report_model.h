// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/host/colmap.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// A model with the world's poses. Each image has num_points keypoints, moved by
// `shift_px` from the projections of their points.
colmap::Reconstruction MakeModel(const SyntheticWorld& world, int num_points,
                                 double shift_px);

}  // namespace adasfm
