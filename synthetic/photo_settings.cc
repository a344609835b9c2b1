// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/photo_settings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/random.h"
#include "core/so3.h"
#include "synthetic/street_grid.h"

namespace adasfm {
namespace {

// Distances of the objects in focus change within seconds.
constexpr double kSlowFocusPeriod = 12.0;  // s
constexpr double kFastFocusPeriod = 5.0;   // s

// Focal errors, up to a common factor.
std::vector<double> DrawFocalWave(const SyntheticWorld& world) {
  Random random = MakeRandom(world.options.seed, 24);
  const double slow_phase = random.Uniform(0.0, 2.0 * kPi);
  const double fast_phase = random.Uniform(0.0, 2.0 * kPi);
  std::vector<double> wave;
  for (int i = 0; i < world.options.num_images; ++i) {
    const double time_s = SecondsFromNs(world.images[i].timestamp_ns -
                                        world.images.front().timestamp_ns);
    wave.push_back(
        std::sin(slow_phase + 2.0 * kPi * time_s / kSlowFocusPeriod) +
        0.5 * std::sin(fast_phase + 2.0 * kPi * time_s / kFastFocusPeriod));
  }
  return wave;
}

// Up to a common factor; changes at random images.
std::vector<double> DrawFocalSteps(const SyntheticWorldOptions& options) {
  Random random = MakeRandom(options.seed, 25);
  std::vector<bool> is_step(options.num_images, false);
  for (const int i :
       random.Sample(options.num_focal_steps, options.num_images - 1)) {
    is_step[i + 1] = true;
  }
  std::vector<double> levels;
  double level = random.Uniform(-1.0, 1.0);
  for (int i = 0; i < options.num_images; ++i) {
    if (is_step[i]) level = random.Uniform(-1.0, 1.0);
    levels.push_back(level);
  }
  return levels;
}

}  // namespace

void SetFocalFactors(SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  if (options.focal_breathing_ratio <= 0.0) return;
  const std::vector<double> errors = options.num_focal_steps > 0
                                         ? DrawFocalSteps(options)
                                         : DrawFocalWave(*world);
  double largest = 0.0;
  for (const double error : errors) {
    largest = std::max(largest, std::abs(error));
  }
  for (size_t i = 0; i < world->images.size(); ++i) {
    world->images[i].focal_factor = 1.0 + options.focal_breathing_ratio *
                                              errors[i % errors.size()] /
                                              largest;
  }
}

void SetExposureGains(SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  Random random = MakeRandom(options.seed, 26);
  const int num_steps = options.num_images - 1;
  const int num_jumps = std::lround(options.exposure_jump_ratio * num_steps);
  if (num_jumps == 0) return;
  std::vector<bool> is_jump(options.num_images, false);
  for (const int i : random.Sample(num_jumps, num_steps)) is_jump[i + 1] = true;
  int exponent = 0;
  for (size_t i = 0; i < world->images.size(); ++i) {
    const size_t frame = i % options.num_images;
    if (frame == 0) {
      // Equal for the second camera.
      random = MakeRandom(options.seed, 27);
      exponent = 0;
    }
    if (is_jump[frame]) {
      const bool is_darker = random.Uniform(0.0, 1.0) < 0.5;
      exponent = exponent != 0 ? 0 : is_darker ? -1 : 1;
    }
    world->images[i].exposure_gain =
        std::pow(options.exposure_jump_factor, exponent);
  }
}

void OpenShutters(const Drive& drive, const std::vector<double>& times_s,
                  SyntheticWorld* world) {
  const double duration_s = world->options.exposure_time_s;
  double shortest_s = std::numeric_limits<double>::infinity();
  for (size_t i = 1; i < times_s.size(); ++i) {
    shortest_s = std::min(shortest_s, times_s[i] - times_s[i - 1]);
  }
  if (duration_s > shortest_s) {
    throw std::invalid_argument(
        "SyntheticWorldOptions: exposure_time_s = " +
        std::to_string(duration_s) +
        ", but the largest possible value of this drive is " +
        std::to_string(shortest_s) + ", the time between two images");
  }
  const std::vector<ExposurePoses> shutters =
      PosesWithin(drive, times_s, duration_s, *world);
  for (size_t i = 0; i < shutters.size(); ++i) {
    world->images[i].shutter = shutters[i];
  }
}

std::vector<ExposurePoses> PosesWithin(const Drive& drive,
                                       const std::vector<double>& times_s,
                                       double duration_s,
                                       const SyntheticWorld& world) {
  std::vector<ExposurePoses> poses;
  const double half_s = 0.5 * duration_s;
  if (half_s <= 0.0) return poses;
  const auto pose_at = [&](double time_s) {
    return world.cam_from_imu * drive.StateAt(time_s).world_from_imu.Inverse();
  };
  for (const double time_s : times_s) {
    poses.push_back({pose_at(time_s - half_s), pose_at(time_s + half_s)});
  }
  while (poses.size() < world.images.size()) {
    const ExposurePoses& first = poses[poses.size() - times_s.size()];
    poses.push_back({world.cam1_from_cam0 * first.first_cam_from_world,
                     world.cam1_from_cam0 * first.last_cam_from_world});
  }
  return poses;
}

std::vector<double> ComputeBlurLengths(const SyntheticWorld& world,
                                       const SyntheticImage& image) {
  std::vector<double> lengths_px;
  if (!image.shutter) return lengths_px;
  const SyntheticCamera camera = CameraOfImage(world.camera, image);
  for (const int id : image.landmark_ids) {
    if (id >= static_cast<int>(world.landmarks.size())) continue;  // on a car
    const Eigen::Vector3d& point = world.landmarks[id];
    Eigen::Vector2d first, last;
    if (!ProjectPoint(camera, image.shutter->first_cam_from_world * point,
                      &first) ||
        !ProjectPoint(camera, image.shutter->last_cam_from_world * point,
                      &last)) {
      continue;
    }
    lengths_px.push_back((last - first).norm());
  }
  return lengths_px;
}

}  // namespace adasfm
