// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "synthetic/synthetic_world.h"
#include "tests/testing/sensors/dataset.h"

namespace adasfm {

// A drive with few keypoints, for tests of the logs.
SyntheticWorldOptions SmallWorld(uint64_t seed, int num_images = 80);

Dataset ToDataset(const SyntheticWorld& world);

struct VisionNoise {
  // Sigma for consecutive images, rad per axis; grows with the root of the gap.
  double sigma_rad = 1e-3;
  int max_gap = 1;
  // Share of rotations that are off by a tenth of a radian.
  double wrong_ratio = 0.0;
};

// Two-view rotations of images up to max_gap apart.
std::vector<VisualRotation> SimulateVision(const SyntheticWorld& world,
                                           uint64_t seed,
                                           const VisionNoise& noise = {});

}  // namespace adasfm
