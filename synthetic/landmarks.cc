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
constexpr double kFacadeTop = 9.0;      // m
// The yard around the lanes, m.
constexpr double kLawnMargin = 6.0;
constexpr double kLawnDensity = 1.0;  // per square metre
constexpr double kPostSpacing = 6.0;  // m, on average
// A facade seen at a flatter angle than this shows no features.
constexpr double kMinIncidenceCosine = 0.1;
constexpr double kImageBorder = 3.0;  // px

class StreetLandmarks {
 public:
  StreetLandmarks(const Street& street, double density, double height,
                  LandmarkMap* map)
      : street_(street),
        density_(density),
        height_(height),
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
                                random_.Uniform(0.2, height_));
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
                            random_.Uniform(0.2, std::min(6.0, height_))),
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
  double height_;
  Random random_;
  LandmarkMap* map_;
};

// A lawn with a fence of posts, in a yard of facades.
class LawnLandmarks {
 public:
  LawnLandmarks(const SyntheticWorldOptions& options, double density,
                LandmarkMap* map)
      : low_(-kLawnMargin, -kLawnMargin),
        high_(options.lane_length_m + kLawnMargin,
              (NumLanes(options) - 1) * options.lane_spacing_m + kLawnMargin),
        density_(density),
        random_(MakeRandom(options.seed, 4)),
        map_(map) {}

  void Build() {
    for (const int axis : {0, 1}) {
      for (const int side : {-1, 1}) AddWall(axis, side);
    }
    const Eigen::Vector2d size = high_ - low_;
    const int num = std::lround(density_ * kLawnDensity * size.x() * size.y());
    for (int i = 0; i < num; ++i) {
      const double x = random_.Uniform(low_.x(), high_.x());
      Add(Eigen::Vector3d(x, random_.Uniform(low_.y(), high_.y()), 0.0),
          Eigen::Vector2d::Zero(), random_.Uniform(4.0, 12.0));
    }
  }

 private:
  // At the low or high end of an axis, with posts 1 m before it.
  void AddWall(int axis, int side) {
    const double begin = low_[1 - axis];
    const double end = high_[1 - axis];
    Eigen::Vector2d normal = Eigen::Vector2d::Zero();
    normal[axis] = -side;
    const auto place = [&](double along, double before, double z) {
      Eigen::Vector3d position(0.0, 0.0, z);
      position[axis] = (side > 0 ? high_ : low_)[axis] - side * before;
      position[1 - axis] = along;
      return position;
    };
    const int num = std::lround(density_ * kFacadeDensity * (end - begin));
    for (int i = 0; i < num; ++i) {
      const double along = random_.Uniform(begin, end);
      const double relief = random_.Uniform(0.0, 0.4);
      Add(place(along, relief, random_.Uniform(0.2, 9.0)), normal,
          random_.Uniform(15.0, kMaxViewDistance));
    }
    const int num_posts = std::lround((end - begin) / kPostSpacing);
    for (int post = 0; post < num_posts; ++post) {
      const double along = random_.Uniform(begin, end);
      for (int i = 0; i < std::lround(density_ * kNumPointsPerPole); ++i) {
        const double dx = random_.Uniform(-0.1, 0.1);
        Add(place(along + dx, 1.0, random_.Uniform(0.1, 2.0)),
            Eigen::Vector2d::Zero(), random_.Uniform(10.0, 40.0));
      }
    }
  }

  void Add(const Eigen::Vector3d& position, const Eigen::Vector2d& normal,
           double max_distance) {
    Landmark landmark;
    landmark.position_in_world = position;
    landmark.normal = normal;
    landmark.max_distance = max_distance;
    landmark.strength = random_.Uniform(0.0, 1.0);
    map_->landmarks.push_back(landmark);
  }

  Eigen::Vector2d low_, high_;
  double density_;
  Random random_;
  LandmarkMap* map_;
};

class Observer {
 public:
  Observer(const StreetGrid& grid, const LandmarkMap& map,
           const SyntheticWorld& world)
      : grid_(grid), map_(map), world_(world) {}

  void Observe(int max_num_keypoints, const ExposurePoses* rows,
               SyntheticImage* image) const {
    const SyntheticCamera camera = CameraOfImage(world_.camera, *image);
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
        if (!IsVisible(map_.landmarks[i], camera, image->cam_from_world, center,
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
    if (static_cast<int>(seen.size()) > max_num_keypoints) {
      seen.resize(max_num_keypoints);
    }
    random.Shuffle(&seen);
    const double sigma = world_.options.pixel_noise_px;
    for (Seen& s : seen) {
      if (rows != nullptr) RollShutter(*rows, camera, s.landmark, &s.pixel);
      const double noise_x = random.Gaussian(sigma);
      image->keypoints.emplace_back(s.pixel.x() + noise_x,
                                    s.pixel.y() + random.Gaussian(sigma));
      image->landmark_ids.push_back(s.landmark);
    }
  }

 private:
  bool IsNear(const Street& street, const Eigen::Vector3d& center) const {
    if (IsOnLawn(world_.options)) return true;
    // In a car park, floors hide the streets of other levels.
    if (world_.options.trajectory == SyntheticTrajectory::kFloors &&
        std::abs(street.HeightAt(0.5 * kBlockSize) + kCameraHeight -
                 center.z()) > 0.5 * world_.options.floor_height_m) {
      return false;
    }
    const Eigen::Vector3d uvz = street.LocalFromWorld(center);
    return std::abs(uvz.x() - 0.5 * kBlockSize) <
               0.5 * kBlockSize + kMaxViewDistance &&
           std::abs(uvz.y()) < kMaxViewDistance + kStreetHalfWidth;
  }

  // Cheap tests first: most landmarks fail the distance.
  bool IsVisible(const Landmark& landmark, const SyntheticCamera& camera,
                 const Rigid3d& cam_from_world, const Eigen::Vector3d& center,
                 Eigen::Vector2d* pixel) const {
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
    if (!ProjectPoint(camera, cam_from_world * landmark.position_in_world,
                      pixel) ||
        pixel->x() < kImageBorder || pixel->y() < kImageBorder ||
        pixel->x() > camera.width - kImageBorder ||
        pixel->y() > camera.height - kImageBorder) {
      return false;
    }
    return IsOnLawn(world_.options) ||
           HasLineOfSight(center.head<2>(),
                          landmark.position_in_world.head<2>());
  }

  // Moves the pixel to its position at the time when its row is read.
  void RollShutter(const ExposurePoses& rows, const SyntheticCamera& camera,
                   int landmark, Eigen::Vector2d* pixel) const {
    // Each round multiplies the error by the ratio of the motion to the image
    // height.
    for (int round = 0; round < 4; ++round) {
      const Rigid3d cam_from_world =
          rows.CamFromWorldAt(pixel->y() / camera.height);
      ProjectPoint(camera,
                   cam_from_world * map_.landmarks[landmark].position_in_world,
                   pixel);
    }
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
  const bool has_floors = options.trajectory == SyntheticTrajectory::kFloors;
  const double height =
      has_floors ? std::min(kFacadeTop, options.floor_height_m) : kFacadeTop;
  for (const Street& street : grid.streets) {
    map.street_begin.push_back(static_cast<int>(map.landmarks.size()));
    if (IsOnLawn(options)) {
      LawnLandmarks(options, density, &map).Build();
    } else {
      StreetLandmarks(street, density, height, &map).Build();
    }
  }
  map.street_begin.push_back(static_cast<int>(map.landmarks.size()));
  return map;
}

int LandmarkMap::StreetOf(int landmark) const {
  return static_cast<int>(
      std::upper_bound(street_begin.begin(), street_begin.end(), landmark) -
      street_begin.begin() - 1);
}

void ObserveLandmarks(const StreetGrid& grid, const LandmarkMap& map,
                      const std::vector<int>& max_num_keypoints,
                      const std::vector<ExposurePoses>& rows,
                      SyntheticWorld* world) {
  const Observer observer(grid, map, *world);
  ParallelFor(-1, world->images.size(), [&](size_t i) {
    observer.Observe(max_num_keypoints[i % max_num_keypoints.size()],
                     rows.empty() ? nullptr : &rows[i], &world->images[i]);
  });
}

}  // namespace adasfm
