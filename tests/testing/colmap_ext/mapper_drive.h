// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "colmap_ext/mapper/local_mapper.h"
#include "tests/testing/colmap_ext/inertial_drive.h"
#include "tests/testing/colmap_ext/mapper_world.h"

namespace adasfm {

// A drive, its model and the adjustment of both with priors.

inline MapperWorld BuildDrive(uint64_t seed) {
  MapperWorldOptions options;
  options.world.num_images = 120;
  options.world.seed = seed;
  return BuildMapperWorld(options);
}

// Reconstructs the drive by vision alone, in the frame of the coarse poses.
inline colmap::Reconstruction Reconstruct(const MapperWorld& world) {
  std::set<image_t> images;
  for (const auto& image : world.data.images) images.insert(image.first);
  return ReconstructLocally({}, world.data, world.coarse_poses, images)
      .reconstruction;
}

// The priors' sigmas are multiplied by sigma_factor.
inline PriorBundleAdjustmentProblem ProblemOf(
    const MapperWorld& world, const colmap::Reconstruction& reconstruction,
    double sigma_factor = 1.0) {
  PriorBundleAdjustmentProblem problem;
  problem.images = {reconstruction.RegImageIds().begin(),
                    reconstruction.RegImageIds().end()};
  for (RelativePosePrior prior : world.data.priors) {
    prior.covariance *= sigma_factor * sigma_factor;
    problem.priors.push_back(PosePriorEdgeFromPrior(prior));
  }
  return problem;
}

inline std::vector<InertialMotion> IntegrateDrive(
    const MapperWorld& world, const InertialDriveOptions& options) {
  std::vector<TimedPose> images;
  for (const auto& [image_id, image] : world.data.images) {
    images.push_back(
        {image_id, *image.timestamp_ns, world.true_poses.at(image_id)});
  }
  return IntegrateDrive(std::move(images), options);
}

}  // namespace adasfm
