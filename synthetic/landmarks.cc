// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/landmarks.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Per metre of facade and 300 keypoints per image.
constexpr double kFacadeDensity = 7.0;
constexpr int kNumPolesPerSide = 5;
constexpr int kNumPointsPerPole = 12;
constexpr double kGroundDensity = 2.0;  // per metre of street
// Share of the visible features that the detector finds in an image.
constexpr double kDetectionRate = 0.8;
// A facade seen at a flatter angle than this shows no features.
constexpr double kMinIncidenceCosine = 0.1;
constexpr double kImageBorder = 3.0;  // px

class StreetLandmarks {
 public:
  StreetLandmarks(const Street& street, double density, LandmarkMap* map)
      : street_(street),
        density_(density),
        random_(MakeRandom(street.layout_seed, 4)),
        map_(map) {}

  void Build() {
    for (const int side : {-1, 1}) {
      AddFacade(side);
      AddPoles(side);
    }
    AddGround();
  }

 private:
  void AddFacade(int side) {
    const double begin = kStreetHalfWidth;
    const double end = kBlockSize - kStreetHalfWidth;
    const int num = std::lround(density_ * kFacadeDensity * (end - begin));
    for (int i = 0; i < num; ++i) {
      // Balconies, signs and sills stand out of the wall a little.
      const double relief = random_.Uniform(0.0, 0.4);
      const Eigen::Vector3d uvz(random_.Uniform(begin, end),
                                side * (kStreetHalfWidth - relief),
                                random_.Uniform(0.2, 9.0));
      Add(uvz, -side, random_.Uniform(15.0, kMaxViewDistance));
    }
  }

  void AddPoles(int side) {
    for (int pole = 0; pole < kNumPolesPerSide; ++pole) {
      const double u = random_.Uniform(0.0, kBlockSize);
      const double v = side * (kStreetHalfWidth - random_.Uniform(1.5, 2.5));
      const int num = std::lround(density_ * kNumPointsPerPole);
      for (int i = 0; i < num; ++i) {
        Add(Eigen::Vector3d(u + random_.Uniform(-0.1, 0.1),
                            v + random_.Uniform(-0.1, 0.1),
                            random_.Uniform(0.2, 6.0)),
            0, random_.Uniform(10.0, 40.0));
      }
    }
  }

  void AddGround() {
    const int num = std::lround(density_ * kGroundDensity * kBlockSize);
    for (int i = 0; i < num; ++i) {
      const double reach = kStreetHalfWidth - 2.0;
      Add(Eigen::Vector3d(random_.Uniform(0.0, kBlockSize),
                          random_.Uniform(-reach, reach), 0.0),
          0, random_.Uniform(6.0, 18.0));
    }
  }

  // normal_side: the sign of the normal along v, 0 for none.
  void Add(const Eigen::Vector3d& uvz, int normal_side, double max_distance) {
    Landmark landmark;
    landmark.position_in_world = street_.WorldFromLocal(uvz);
    const Eigen::Vector2d d = street_.Direction();
    landmark.normal = normal_side * Eigen::Vector2d(-d.y(), d.x());
    landmark.max_distance = max_distance;
    landmark.strength = random_.Uniform(0.0, 1.0);
    map_->landmarks.push_back(landmark);
  }

  const Street& street_;
  double density_;
  Random random_;
  LandmarkMap* map_;
};

class Observer {
 public:
  Observer(const StreetGrid& grid, const LandmarkMap& map,
           const SyntheticWorld& world)
      : grid_(grid), map_(map), world_(world) {}

  void Observe(SyntheticImage* image) const {
    Random random = MakeRandom(world_.options.seed, 5, image->image_id);
    struct Seen {
      int landmark;
      Eigen::Vector2d pixel;
    };
    std::vector<Seen> seen;
    const Eigen::Vector3d center = image->cam_from_world.TargetOriginInSource();
    for (size_t street = 0; street < grid_.streets.size(); ++street) {
      if (!IsNear(grid_.streets[street], center)) continue;
      for (int i = map_.street_begin[street]; i < map_.street_begin[street + 1];
           ++i) {
        Eigen::Vector2d pixel;
        if (!IsVisible(map_.landmarks[i], image->cam_from_world, center,
                       &pixel)) {
          continue;
        }
        if (random.Uniform(0.0, 1.0) > kDetectionRate) continue;
        seen.push_back({i, pixel});
      }
    }
    std::sort(seen.begin(), seen.end(), [&](const Seen& a, const Seen& b) {
      const double strength_a = map_.landmarks[a.landmark].strength;
      const double strength_b = map_.landmarks[b.landmark].strength;
      return strength_a != strength_b ? strength_a > strength_b
                                      : a.landmark < b.landmark;
    });
    if (seen.size() > world_.options.num_keypoints_per_image) {
      seen.resize(world_.options.num_keypoints_per_image);
    }
    random.Shuffle(&seen);
    const double sigma = world_.options.pixel_noise_px;
    for (const Seen& s : seen) {
      const double noise_x = random.Gaussian(sigma);
      image->keypoints.emplace_back(s.pixel.x() + noise_x,
                                    s.pixel.y() + random.Gaussian(sigma));
      image->landmark_ids.push_back(s.landmark);
    }
  }

 private:
  static bool IsNear(const Street& street, const Eigen::Vector3d& center) {
    const Eigen::Vector3d uvz = street.LocalFromWorld(center);
    return std::abs(uvz.x() - 0.5 * kBlockSize) <
               0.5 * kBlockSize + kMaxViewDistance &&
           std::abs(uvz.y()) < kMaxViewDistance + kStreetHalfWidth;
  }

  // Cheap tests first: most landmarks fail the distance.
  bool IsVisible(const Landmark& landmark, const Rigid3d& cam_from_world,
                 const Eigen::Vector3d& center, Eigen::Vector2d* pixel) const {
    const Eigen::Vector3d ray = landmark.position_in_world - center;
    const double distance = ray.norm();
    if (distance > landmark.max_distance ||
        distance < landmark.max_distance / 8.0) {
      return false;
    }
    if (landmark.normal != Eigen::Vector2d::Zero() &&
        -landmark.normal.dot(ray.head<2>()) < kMinIncidenceCosine * distance) {
      return false;
    }
    const SyntheticCamera& camera = world_.camera;
    if (!ProjectPoint(camera, cam_from_world * landmark.position_in_world,
                      pixel) ||
        pixel->x() < kImageBorder || pixel->y() < kImageBorder ||
        pixel->x() > camera.width - kImageBorder ||
        pixel->y() > camera.height - kImageBorder) {
      return false;
    }
    return HasLineOfSight(center.head<2>(),
                          landmark.position_in_world.head<2>());
  }

  const StreetGrid& grid_;
  const LandmarkMap& map_;
  const SyntheticWorld& world_;
};

}  // namespace

LandmarkMap BuildLandmarks(const SyntheticWorldOptions& options,
                           const StreetGrid& grid) {
  LandmarkMap map;
  const double density = options.num_keypoints_per_image / 300.0;
  for (const Street& street : grid.streets) {
    map.street_begin.push_back(static_cast<int>(map.landmarks.size()));
    StreetLandmarks(street, density, &map).Build();
  }
  map.street_begin.push_back(static_cast<int>(map.landmarks.size()));
  for (size_t i = 0; i < grid.streets.size(); ++i) {
    if (grid.streets[i].twin < 0) continue;
    const int offset =
        map.street_begin[grid.streets[i].twin] - map.street_begin[i];
    for (int k = map.street_begin[i]; k < map.street_begin[i + 1]; ++k) {
      map.landmarks[k].twin = k + offset;
    }
  }
  return map;
}

void ObserveLandmarks(const StreetGrid& grid, const LandmarkMap& map,
                      const std::vector<bool>& is_blacked_out,
                      SyntheticWorld* world) {
  const Observer observer(grid, map, *world);
  ParallelFor(-1, world->images.size(), [&](size_t i) {
    if (!is_blacked_out[i % is_blacked_out.size()])
      observer.Observe(&world->images[i]);
  });
}

}  // namespace adasfm
