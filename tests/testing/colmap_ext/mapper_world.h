// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>

#include "colmap_ext/scene/scene_data.h"
#include "core/random.h"
#include "core/rigid3d.h"
#include "core/so3.h"
#include "core/types.h"
#include "synthetic/synthetic_world.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {

// Input of the mapper without the stages before it: the scene of a synthetic
// world, and poses that are the truth with noise.
struct MapperWorld {
  SceneData data;
  std::map<image_t, Rigid3d> true_poses;
  std::map<image_t, Rigid3d> coarse_poses;
};

struct MapperWorldOptions {
  SyntheticWorldOptions world;
  SyntheticPriorOptions priors;
  // Sigmas of the coarse poses, independent for each image.
  double center_sigma_m = 0.2;
  double rotation_sigma_rad = 0.005;
};

// A drive without logs that is filmed while it stands.
inline MapperWorldOptions WorldWithStop(int num_images, double stop_s,
                                        uint64_t seed) {
  MapperWorldOptions options;
  options.world.num_images = num_images;
  options.world.num_stops = 1;
  options.world.stop_duration_s = stop_s;
  options.world.stop_image_interval_s = 0.5;
  options.world.seed = seed;
  options.priors.enabled = false;
  options.center_sigma_m = 0.005;
  return options;
}

inline MapperWorld BuildMapperWorld(const MapperWorldOptions& options) {
  const SyntheticWorld world = BuildSyntheticWorld(options.world);
  MapperWorld result;
  result.data = BuildSyntheticScene(world, options.priors);
  Random random(options.world.seed);
  for (const SyntheticImage& image : world.images) {
    const Rigid3d& pose = image.cam_from_world;
    result.true_poses[image.image_id] = pose;
    result.coarse_poses[image.image_id] = CamFromWorldWithCenter(
        ExpSo3(random.GaussianVector(options.rotation_sigma_rad)) *
            pose.rotation,
        pose.TargetOriginInSource() +
            random.GaussianVector(options.center_sigma_m));
  }
  return result;
}

}  // namespace adasfm
