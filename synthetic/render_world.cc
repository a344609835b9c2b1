// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/render_world.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "synthetic/find_wall.h"
#include "synthetic/paint_textures.h"
#include "synthetic/photo_settings.h"

namespace adasfm {
namespace {

constexpr double kFacadeHeight = 10.0;
constexpr double kFacadePxPerM = 45.0;
constexpr double kRoadPxPerM = 30.0;
constexpr double kHazeDistance = 400.0;
constexpr double kLensBlurPx = 0.5;
constexpr double kSensorNoise = 1.2;  // grey levels, 1 sigma
constexpr int kMaxNumMoments = 64;

const Eigen::Vector3f kHaze(225.0f, 215.0f, 205.0f);

// Smooth, so that no features are detected in the sky.
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

// Moments while the shutter is open: up to kMaxNumMoments, at most a pixel of
// motion apart for the fastest keypoint.
int NumMoments(const SyntheticWorld& world, const SyntheticImage& image) {
  const std::vector<double> lengths_px = ComputeBlurLengths(world, image);
  if (lengths_px.empty()) return 1;
  const double longest_px =
      *std::max_element(lengths_px.begin(), lengths_px.end());
  return std::clamp(static_cast<int>(std::ceil(longest_px)), 1, kMaxNumMoments);
}

}  // namespace

WorldRenderer::WorldRenderer(const SyntheticWorld& world)
    : world_(world), grid_(BuildStreetGrid(world.options, world.num_twins)) {}

void WorldRenderer::AimRays(double focal_factor) {
  if (focal_factor == rays_focal_factor_) return;
  rays_focal_factor_ = focal_factor;
  SyntheticCamera camera = world_.camera;
  camera.focal_px *= focal_factor;
  rays_in_cam_.clear();
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

cv::Mat WorldRenderer::RenderLight(const Rigid3d& cam_from_world) {
  const SyntheticCamera& camera = world_.camera;
  cv::Mat picture(camera.height, camera.width, CV_32FC3);
  const Eigen::Vector3d center = cam_from_world.TargetOriginInSource();
  const Eigen::Matrix3d world_from_cam =
      cam_from_world.rotation.toRotationMatrix().transpose();
  for (int y = 0; y < camera.height; ++y) {
    float* row = picture.ptr<float>(y);
    for (int x = 0; x < camera.width; ++x) {
      PixelRay ray = rays_in_cam_[y * camera.width + x];
      ray.direction = world_from_cam * ray.direction;
      Eigen::Map<Eigen::Vector3f>(row + 3 * x) = Shade(center, ray);
    }
  }
  return picture;
}

cv::Mat WorldRenderer::CollectLight(const SyntheticImage& image) {
  const SyntheticCamera& camera = world_.camera;
  if (image.keypoints.empty()) {
    return cv::Mat(camera.height, camera.width, CV_32FC3,
                   cv::Scalar(60.0, 60.0, 60.0));
  }
  AimRays(image.focal_factor);
  const int num_moments = NumMoments(world_, image);
  if (num_moments == 1) return RenderLight(image.cam_from_world);
  cv::Mat sum(camera.height, camera.width, CV_32FC3, cv::Scalar());
  for (int i = 0; i < num_moments; ++i) {
    sum += RenderLight(image.shutter->CamFromWorldAt((i + 0.5) / num_moments));
  }
  return sum / num_moments;
}

cv::Mat WorldRenderer::Render(size_t image_index) {
  if (image_index >= world_.images.size()) {
    throw std::out_of_range("WorldRenderer: no image of that index");
  }
  const SyntheticImage& image = world_.images[image_index];
  cv::Mat picture = CollectLight(image);
  picture *= image.exposure_gain;
  AddLensAndNoise(image_index, &picture);
  cv::Mat bytes;
  picture.convertTo(bytes, CV_8UC3);
  return bytes;
}

}  // namespace adasfm
