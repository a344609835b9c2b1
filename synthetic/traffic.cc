// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/traffic.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/so3.h"
#include "synthetic/landmarks.h"
#include "synthetic/street_grid.h"

namespace adasfm {
namespace {

// In the frame of a car, m: its rear and its right side, which the camera sees.
std::vector<Eigen::Vector3d> DrawCarPoints(Random* random) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kNumPointsPerCar; ++i) {
    const bool is_rear = random->Uniform(0.0, 1.0) < 0.7;
    const double x =
        is_rear ? random->Uniform(-0.1, 0.0) : random->Uniform(0.0, 4.0);
    const double y = is_rear ? random->Uniform(-0.9, 0.9) : -0.9;
    points.emplace_back(x, y, random->Uniform(0.3, 1.5));
  }
  return points;
}

// Position of car k in the frame of the road below the IMU: x forward.
Eigen::Vector3d CarPosition(int k, double time_s) {
  return k == 0
             ? Eigen::Vector3d(10.0 + 2.0 * std::sin(2.0 * kPi * time_s / 17.0),
                               0.0, 0.0)
             : Eigen::Vector3d(9.0 + 3.0 * std::sin(2.0 * kPi * time_s / 23.0),
                               3.3, 0.0);
}

Rigid3d RoadFromWorld(const Rigid3d& imu_from_world) {
  const Eigen::Vector3d forward =
      imu_from_world.rotation.conjugate() * Eigen::Vector3d::UnitX();
  const double yaw = std::atan2(forward.y(), forward.x());
  Eigen::Vector3d below = imu_from_world.TargetOriginInSource();
  below.z() -= 0.6;
  return CamFromWorldWithCenter(
      Eigen::Quaterniond(Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ())),
      below);
}

class CarPainter {
 public:
  explicit CarPainter(SyntheticWorld* world) : world_(*world) {
    Random random = MakeRandom(world->options.seed, 17);
    for (int k = 0; k < kNumCars; ++k) {
      points_.push_back(DrawCarPoints(&random));
    }
  }

  void Paint(SyntheticImage* image) const {
    const double time_s =
        SecondsFromNs(image->timestamp_ns - world_.images.front().timestamp_ns);
    const Rigid3d world_from_road =
        RoadFromWorld(world_.cam_from_imu.Inverse() * image->cam_from_world)
            .Inverse();
    for (int k = 0; k < kNumCars; ++k) {
      image->cam_from_car.push_back(
          image->cam_from_world * world_from_road *
          Rigid3d(Eigen::Quaterniond::Identity(), CarPosition(k, time_s)));
    }
    Random random = MakeRandom(world_.options.seed, 18, image->image_id);
    const int num = static_cast<int>(image->keypoints.size());
    image->car_point_ids.assign(num, -1);
    const int num_moving =
        std::lround(world_.options.moving_keypoint_ratio * num);
    // The keypoints are in random order: the first ones are replaced.
    int keypoint = 0;
    for (int i = 0; i < kNumPointsPerCar && keypoint < num_moving; ++i) {
      for (int k = 0; k < kNumCars && keypoint < num_moving; ++k) {
        if (random.Uniform(0.0, 1.0) > kDetectionRate) continue;
        keypoint += Replace(k, i, keypoint, &random, image);
      }
    }
    if (keypoint < num_moving) {
      throw std::invalid_argument(
          "SyntheticWorldOptions: moving_keypoint_ratio = " +
          std::to_string(world_.options.moving_keypoint_ratio) +
          " needs more points than the cars have; the largest possible value "
          "is " +
          std::to_string(static_cast<double>(keypoint) / num));
    }
  }

 private:
  // False when the point is not in view.
  bool Replace(int car, int point, int keypoint, Random* random,
               SyntheticImage* image) const {
    const SyntheticCamera camera = CameraOfImage(world_.camera, *image);
    Eigen::Vector2d pixel;
    if (!ProjectPoint(camera, image->cam_from_car[car] * points_[car][point],
                      &pixel) ||
        pixel.x() < 0.0 || pixel.y() < 0.0 || pixel.x() > camera.width ||
        pixel.y() > camera.height) {
      return false;
    }
    const double sigma = world_.options.pixel_noise_px;
    const double noise_x = random->Gaussian(sigma);
    image->keypoints[keypoint] =
        pixel + Eigen::Vector2d(noise_x, random->Gaussian(sigma));
    image->car_point_ids[keypoint] = kNumPointsPerCar * car + point;
    image->landmark_ids[keypoint] =
        static_cast<int>(world_.landmarks.size()) +
        static_cast<int>(image->image_id) * kNumCars * kNumPointsPerCar +
        image->car_point_ids[keypoint];
    return true;
  }

  SyntheticWorld& world_;
  std::vector<std::vector<Eigen::Vector3d>> points_;
};

}  // namespace

void AddTraffic(SyntheticWorld* world) {
  if (world->options.moving_keypoint_ratio <= 0.0) return;
  const CarPainter painter(world);
  for (SyntheticImage& image : world->images) painter.Paint(&image);
}

}  // namespace adasfm
