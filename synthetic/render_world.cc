// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/render_world.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "synthetic/paint_textures.h"

namespace adasfm {
namespace {

constexpr double kFacadeHeight = 10.0;
constexpr double kFacadePxPerM = 45.0;
constexpr double kRoadPxPerM = 30.0;
constexpr double kViewLimit = 250.0;
constexpr double kHazeDistance = 400.0;
constexpr double kLensBlurPx = 0.5;
constexpr double kSensorNoise = 1.2;  // grey levels, 1 sigma

const Eigen::Vector3f kHaze(225.0f, 215.0f, 205.0f);

// Smooth, so that no feature sticks to the sky.
Eigen::Vector3f ShadeSky(const Eigen::Vector3d& direction) {
  const float up = static_cast<float>(std::max(0.0, direction.z()));
  return kHaze - up * Eigen::Vector3f(15.0f, 55.0f, 85.0f);
}

Eigen::Vector3f Haze(const Eigen::Vector3f& color, double distance) {
  const float clear = static_cast<float>(std::exp(-distance / kHazeDistance));
  return clear * color + (1.0f - clear) * kHaze;
}

// Half the long axis of a pixel's footprint on a surface.
double HalfAxis(double width, double incidence_cosine) {
  return 0.5 * width / std::max(incidence_cosine, 0.02);
}

struct WallHit {
  double distance = std::numeric_limits<double>::infinity();
  // The crossings at the ends of the street that the wall belongs to.
  GridNode from = {0, 0};
  GridNode to = {0, 0};
};

// Meets one block; distances along the (not normalised) direction.
bool HitBlock(const Eigen::Vector2d& from, const Eigen::Vector2d& direction,
              int column, int row, WallHit* hit) {
  const int cell[2] = {column, row};
  double enter = 0.0;
  double leave = std::numeric_limits<double>::infinity();
  int axis = -1;
  for (int k = 0; k < 2; ++k) {
    const double low = cell[k] * kBlockSize + kStreetHalfWidth;
    const double high = (cell[k] + 1) * kBlockSize - kStreetHalfWidth;
    if (std::abs(direction[k]) < 1e-12) {
      if (from[k] <= low || from[k] >= high) return false;
      continue;
    }
    double a = (low - from[k]) / direction[k];
    double b = (high - from[k]) / direction[k];
    if (a > b) std::swap(a, b);
    if (a > enter) {
      enter = a;
      axis = k;
    }
    leave = std::min(leave, b);
  }
  if (axis < 0 || enter >= leave) return false;
  hit->distance = enter;
  hit->from = {column, row};
  if (direction[axis] < 0.0) ++hit->from[axis];
  hit->to = hit->from;
  ++hit->to[1 - axis];
  return true;
}

// The first wall along the ray, walking through the cells of the grid.
WallHit FindWall(const Eigen::Vector2d& from,
                 const Eigen::Vector2d& direction) {
  WallHit hit;
  int cell[2];
  double next[2];
  double step[2];
  for (int k = 0; k < 2; ++k) {
    cell[k] = static_cast<int>(std::floor(from[k] / kBlockSize));
    const double edge = (cell[k] + (direction[k] > 0.0)) * kBlockSize;
    const bool moves = std::abs(direction[k]) > 1e-12;
    const double infinity = std::numeric_limits<double>::infinity();
    next[k] = moves ? (edge - from[k]) / direction[k] : infinity;
    step[k] = moves ? kBlockSize / std::abs(direction[k]) : infinity;
  }
  double distance = 0.0;
  const double limit = kViewLimit / std::max(direction.norm(), 1e-9);
  while (distance < limit) {
    if (HitBlock(from, direction, cell[0], cell[1], &hit)) return hit;
    const int k = next[0] < next[1] ? 0 : 1;
    distance = next[k];
    cell[k] += direction[k] > 0.0 ? 1 : -1;
    next[k] += step[k];
  }
  return hit;
}

}  // namespace

WorldRenderer::WorldRenderer(const SyntheticWorld& world)
    : world_(world), grid_(BuildStreetGrid(world.options, world.num_twins)) {
  const SyntheticCamera& camera = world.camera;
  rays_in_cam_.reserve(camera.width * camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Bearing bearing =
          ComputeBearing(camera, Eigen::Vector2d(x + 0.5, y + 0.5));
      rays_in_cam_.push_back(
          {bearing.direction, std::sqrt(bearing.jacobian.col(0).norm() *
                                        bearing.jacobian.col(1).norm())});
    }
  }
}

const Street& WorldRenderer::StreetBetween(const GridNode& a,
                                           const GridNode& b) {
  const StreetId id = MakeStreetId(a, b);
  const auto found = grid_.street_from_id.find(id);
  if (found != grid_.street_from_id.end()) {
    return grid_.streets[found->second];
  }
  // A street far from the route.
  Street& street = far_streets_[id];
  street.from = std::get<1>(id);
  street.to = std::get<2>(id);
  const uint64_t place =
      static_cast<uint64_t>(street.from[0] + 100000) * 400009 +
      2 * (street.from[1] + 100000) + (street.from[0] != street.to[0]);
  street.layout_seed = place;
  return street;
}

const WorldRenderer::Facade& WorldRenderer::FacadeOf(const Street& street,
                                                     int side) {
  const auto key = std::make_tuple(street.layout_seed, side);
  const auto found = facades_.find(key);
  if (found != facades_.end()) return found->second;
  Random random = MakeRandom(street.layout_seed, 20, side + 1);
  const FacadePicture picture =
      PaintFacade(kBlockSize - 2.0 * kStreetHalfWidth, kFacadeHeight,
                  kFacadePxPerM, &random);
  Facade& facade = facades_[key];
  facade.texture = MipTexture(picture.picture, kFacadePxPerM);
  facade.height_m = picture.height_m;
  return facade;
}

const MipTexture& WorldRenderer::RoadOf(const Street& street) {
  const auto found = roads_.find(street.layout_seed);
  if (found != roads_.end()) return found->second;
  Random random = MakeRandom(street.layout_seed, 21);
  MipTexture& road = roads_[street.layout_seed];
  road = MipTexture(PaintRoad(kBlockSize - 2.0 * kStreetHalfWidth,
                              2.0 * kStreetHalfWidth, kRoadPxPerM, &random),
                    kRoadPxPerM);
  return road;
}

const MipTexture& WorldRenderer::CrossingOf(const GridNode& node) {
  const auto found = crossings_.find(node);
  if (found != crossings_.end()) return found->second;
  Random random = MakeRandom(
      world_.options.seed, 22,
      static_cast<uint64_t>(node[0] + 100000) * 400009 + (node[1] + 100000));
  MipTexture& crossing = crossings_[node];
  crossing = MipTexture(PaintRoad(2.0 * kStreetHalfWidth,
                                  2.0 * kStreetHalfWidth, kRoadPxPerM, &random),
                        kRoadPxPerM);
  return crossing;
}

bool WorldRenderer::ShadeWall(const Eigen::Vector3d& center,
                              const PixelRay& ray, double* distance,
                              Eigen::Vector3f* color) {
  const WallHit hit = FindWall(center.head<2>(), ray.direction.head<2>());
  *distance = hit.distance;
  const Eigen::Vector3d point = center + hit.distance * ray.direction;
  if (!(hit.distance < kViewLimit) || point.z() < 0.0 ||
      point.z() > kFacadeHeight) {
    return false;
  }
  const Street& street = StreetBetween(hit.from, hit.to);
  const Eigen::Vector3d uvz = street.LocalFromWorld(point);
  const Facade& facade = FacadeOf(street, uvz.y() > 0.0 ? 1 : -1);
  const double u = uvz.x() - kStreetHalfWidth;
  const int column = std::clamp(static_cast<int>(u * kFacadePxPerM), 0,
                                static_cast<int>(facade.height_m.size()) - 1);
  if (point.z() > facade.height_m[column]) return false;
  const Eigen::Vector2d along(street.Direction().dot(ray.direction.head<2>()),
                              ray.direction.z());
  const double cosine = std::sqrt(std::max(0.0, 1.0 - along.squaredNorm()));
  const double width = hit.distance * ray.angle_rad;
  *color = Haze(facade.texture.Sample(Eigen::Vector2d(u, point.z()), width,
                                      HalfAxis(width, cosine) * along /
                                          std::max(along.norm(), 1e-9)),
                hit.distance);
  return true;
}

Eigen::Vector3f WorldRenderer::ShadeGround(const Eigen::Vector3d& center,
                                           const PixelRay& ray) {
  const double distance = -center.z() / ray.direction.z();
  if (!(distance < kViewLimit)) return kHaze;
  const Eigen::Vector3d point = center + distance * ray.direction;
  const double width = distance * ray.angle_rad;
  Eigen::Vector2d axis = ray.direction.head<2>();
  axis *= HalfAxis(width, -ray.direction.z()) / std::max(axis.norm(), 1e-9);
  // The nearest crossing, and the place relative to it.
  const GridNode node = {static_cast<int>(std::lround(point.x() / kBlockSize)),
                         static_cast<int>(std::lround(point.y() / kBlockSize))};
  const Eigen::Vector2d offset(point.x() - node[0] * kBlockSize,
                               point.y() - node[1] * kBlockSize);
  const Eigen::Vector2d half(kStreetHalfWidth, kStreetHalfWidth);
  const bool in_x = std::abs(offset.x()) <= kStreetHalfWidth;
  const bool in_y = std::abs(offset.y()) <= kStreetHalfWidth;
  if (in_x == in_y) {
    return Haze(CrossingOf(node).Sample(offset + half, width, axis), distance);
  }
  GridNode other = node;
  const int k = in_y ? 0 : 1;
  other[k] += offset[k] > 0.0 ? 1 : -1;
  const Street& street = StreetBetween(node, other);
  const Eigen::Vector3d uvz = street.LocalFromWorld(point);
  const Eigen::Vector2d d = street.Direction();
  return Haze(
      RoadOf(street).Sample(
          uvz.head<2>() + Eigen::Vector2d(-kStreetHalfWidth, kStreetHalfWidth),
          width,
          Eigen::Vector2d(d.dot(axis), d.x() * axis.y() - d.y() * axis.x())),
      distance);
}

Eigen::Vector3f WorldRenderer::Shade(const Eigen::Vector3d& center,
                                     const PixelRay& ray) {
  double wall_distance = 0.0;
  Eigen::Vector3f color;
  if (ShadeWall(center, ray, &wall_distance, &color)) return color;
  if (ray.direction.z() < -1e-6) return ShadeGround(center, ray);
  return ShadeSky(ray.direction);
}

void WorldRenderer::AddLensAndNoise(size_t image_index,
                                    cv::Mat* picture) const {
  cv::GaussianBlur(*picture, *picture, cv::Size(0, 0), kLensBlurPx);
  Random random = MakeRandom(world_.options.seed, 23, image_index);
  for (int y = 0; y < picture->rows; ++y) {
    float* row = picture->ptr<float>(y);
    for (int x = 0; x < picture->cols; ++x) {
      const float noise = static_cast<float>(random.Gaussian(kSensorNoise));
      for (int k = 0; k < 3; ++k) row[3 * x + k] += noise;
    }
  }
}

cv::Mat WorldRenderer::Render(size_t image_index) {
  if (image_index >= world_.images.size()) {
    throw std::out_of_range("WorldRenderer: no image of that index");
  }
  const SyntheticImage& image = world_.images[image_index];
  const SyntheticCamera& camera = world_.camera;
  cv::Mat picture(camera.height, camera.width, CV_32FC3,
                  cv::Scalar(60.0, 60.0, 60.0));
  if (!image.keypoints.empty()) {
    const Eigen::Vector3d center = image.cam_from_world.TargetOriginInSource();
    const Eigen::Matrix3d world_from_cam =
        image.cam_from_world.rotation.toRotationMatrix().transpose();
    for (int y = 0; y < camera.height; ++y) {
      float* row = picture.ptr<float>(y);
      for (int x = 0; x < camera.width; ++x) {
        PixelRay ray = rays_in_cam_[y * camera.width + x];
        ray.direction = world_from_cam * ray.direction;
        Eigen::Map<Eigen::Vector3f>(row + 3 * x) = Shade(center, ray);
      }
    }
  }
  AddLensAndNoise(image_index, &picture);
  cv::Mat bytes;
  picture.convertTo(bytes, CV_8UC3);
  return bytes;
}

}  // namespace adasfm
