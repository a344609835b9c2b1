// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/host/colmap.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// Poses of the world as a model, some keypoints seen where they should be, and
// moved by `shift_px`.
colmap::Reconstruction MakeModel(const SyntheticWorld& world, int num_points,
                                 double shift_px);

}  // namespace adasfm
