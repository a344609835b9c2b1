// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/sensors/synthetic_dataset.h"

#include <cmath>

#include "core/random.h"
#include "core/so3.h"

namespace adasfm {

SyntheticWorldOptions SmallWorld(uint64_t seed, int num_images) {
  SyntheticWorldOptions options;
  options.num_images = num_images;
  options.seed = seed;
  // Only the logs matter here.
  options.num_keypoints_per_image = 8;
  options.num_sequential_neighbors = 1;
  return options;
}

Dataset ToDataset(const SyntheticWorld& world) {
  Dataset data;
  SensorCalibration& calibration = data.calibration;
  calibration.cam_from_imu = world.cam_from_imu;
  calibration.timeshift_cam_imu_s = world.options.timeshift_cam_imu_s;
  calibration.has_imu = true;
  calibration.imu_noise = world.options.imu_noise;
  calibration.imu_rate_hz = world.options.imu_rate_hz;
  calibration.has_wheel = true;
  calibration.wheel_type = WheelType::kDifferential;
  calibration.track_width_m = world.track_width_m;
  calibration.wheel_speed_noise = world.options.wheel_speed_noise;
  calibration.imu_from_wheel = world.imu_from_wheel;
  data.logs.imu = world.imu_samples;
  data.logs.wheel = world.wheel_samples;
  for (const SyntheticImage& image : world.images) {
    data.images.push_back({image.image_id, image.name, image.timestamp_ns});
    data.cams_from_world[image.image_id] = image.cam_from_world;
  }
  return data;
}

std::vector<VisualRotation> SimulateVision(const SyntheticWorld& world,
                                           uint64_t seed,
                                           const VisionNoise& noise) {
  Random random(seed);
  std::vector<VisualRotation> rotations;
  const int num = static_cast<int>(world.images.size());
  for (int i = 0; i < num; ++i) {
    for (int gap = 1; gap <= noise.max_gap && i + gap < num; ++gap) {
      const SyntheticImage& first = world.images[i];
      const SyntheticImage& second = world.images[i + gap];
      const Eigen::Quaterniond truth =
          ComputeCam2FromCam1(first.cam_from_world, second.cam_from_world)
              .rotation;
      const bool is_wrong = random.Uniform(0.0, 1.0) < noise.wrong_ratio;
      const double sigma =
          is_wrong ? 0.1 : noise.sigma_rad * std::sqrt(1.0 * gap);
      rotations.push_back({first.image_id, second.image_id,
                           ExpSo3(random.GaussianVector(sigma)) * truth, 100});
    }
  }
  return rotations;
}

}  // namespace adasfm
