// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/register_image.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "colmap_ext/host/pose_conversion.h"
#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// More co-visible images hardly change a median.
constexpr size_t kMaxNumNeighbors = 15;
// P3P needs more inliers than v_p: no other pose confirms it.
constexpr int kMinNumP3pInliers = 15;
// Inliers over visible points from which on P3P is not tried: the coarse
// candidate is refined on the points that P3P would be refined on, too.
constexpr double kEnoughInlierRatio = 0.9;

// The registered images, with coarse poses, that image_id is matched or tied
// to, strongest first.
std::vector<image_t> FindRegisteredNeighbors(const MapperScene& scene,
                                             image_t image_id) {
  std::vector<image_t> candidates;
  for (const auto& [neighbor, num_matches] : scene.neighbors.at(image_id)) {
    candidates.push_back(neighbor);
  }
  const auto prior_indices = scene.priors_of_image.find(image_id);
  if (prior_indices != scene.priors_of_image.end()) {
    for (const size_t i : prior_indices->second) {
      const RelativePosePrior& prior = scene.priors[i];
      candidates.push_back(prior.image_id1 == image_id ? prior.image_id2
                                                       : prior.image_id1);
    }
  }
  std::vector<image_t> neighbors;
  std::set<image_t> seen;
  for (const image_t candidate : candidates) {
    if (neighbors.size() == kMaxNumNeighbors) break;
    if (IsRegistered(scene.reconstruction, candidate) &&
        scene.coarse->count(candidate) && seen.insert(candidate).second) {
      neighbors.push_back(candidate);
    }
  }
  return neighbors;
}

// Local lengths over coarse lengths between the neighbours (median); 1 when
// they are stationary.
double ComputeLocalScale(const MapperScene& scene,
                         const std::vector<image_t>& neighbors) {
  std::vector<double> ratios;
  for (size_t i = 0; i < neighbors.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const double coarse =
          (scene.coarse->at(neighbors[i]).TargetOriginInSource() -
           scene.coarse->at(neighbors[j]).TargetOriginInSource())
              .norm();
      const double local =
          (CamFromWorld(scene.reconstruction.Image(neighbors[i]))
               .TargetOriginInSource() -
           CamFromWorld(scene.reconstruction.Image(neighbors[j]))
               .TargetOriginInSource())
              .norm();
      if (coarse > 1e-6 && local > 1e-6) ratios.push_back(local / coarse);
    }
  }
  return ratios.empty() ? 1.0 : Median(ratios);
}

Eigen::Quaterniond L1MeanRotation(
    const std::vector<Eigen::Quaterniond>& rotations) {
  // The first one comes from the strongest neighbour.
  Eigen::Quaterniond mean = rotations.front();
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    double sum_weights = 0.0;
    for (const Eigen::Quaterniond& rotation : rotations) {
      const Eigen::Vector3d difference = LogSo3(rotation * mean.conjugate());
      const double weight = 1.0 / std::max(1e-6, difference.norm());
      step += weight * difference;
      sum_weights += weight;
    }
    step /= sum_weights;
    mean = (ExpSo3(step) * mean).normalized();
    if (step.norm() < 1e-7) break;
  }
  return mean;
}

// Each keypoint with the points that its matches see.
PointsInImage CollectPoints(const MapperScene& scene, image_t image_id) {
  PointsInImage points;
  const colmap::Image& image = scene.reconstruction.Image(image_id);
  std::vector<colmap::point3D_t> seen;
  std::vector<MatchedKeypoint> matches;
  for (point2D_t idx = 0; idx < image.NumPoints2D(); ++idx) {
    seen.clear();
    scene.mapper.FindMatches(image_id, idx, &matches);
    for (const MatchedKeypoint& match : matches) {
      const colmap::Point2D& other =
          scene.reconstruction.Image(match.image_id).Point2D(match.point2D_idx);
      if (!other.HasPoint3D() ||
          std::find(seen.begin(), seen.end(), PointIdOf(other)) != seen.end()) {
        continue;
      }
      seen.push_back(PointIdOf(other));
      points.pixels.push_back(XyOf(image.Point2D(idx)));
      points.points_in_world.push_back(
          XyzOf(scene.reconstruction.Point3D(PointIdOf(other))));
    }
  }
  return points;
}

// True where the point projects within max_error_px of its keypoint.
std::vector<char> FindInliers(const PointsInImage& points,
                              const colmap::Camera& camera,
                              const Rigid3d& cam_from_world,
                              double max_error_px) {
  const Eigen::Matrix3d rotation = cam_from_world.rotation.toRotationMatrix();
  std::vector<char> mask(points.pixels.size(), 0);
  for (size_t i = 0; i < mask.size(); ++i) {
    const Eigen::Vector3d point_in_cam =
        rotation * points.points_in_world[i] + cam_from_world.translation;
    if (point_in_cam.z() < 1e-6) continue;
    const Eigen::Vector2d pixel =
        PixelFromPlane(camera, point_in_cam.hnormalized());
    mask[i] = (pixel - points.pixels[i]).norm() <= max_error_px;
  }
  return mask;
}

size_t CountInliers(const std::vector<char>& mask) {
  return std::count(mask.begin(), mask.end(), 1);
}

}  // namespace

std::optional<Rigid3d> ComputeGlobalCandidate(const MapperScene& scene,
                                              image_t image_id) {
  const auto coarse = scene.coarse->find(image_id);
  if (coarse == scene.coarse->end()) return std::nullopt;
  const std::vector<image_t> neighbors =
      FindRegisteredNeighbors(scene, image_id);
  if (neighbors.empty()) return std::nullopt;
  const double scale = ComputeLocalScale(scene, neighbors);
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<double> coordinates[3];
  for (const image_t neighbor : neighbors) {
    const Rigid3d local = CamFromWorld(scene.reconstruction.Image(neighbor));
    const Rigid3d& coarse_neighbor = scene.coarse->at(neighbor);
    const Eigen::Quaterniond local_from_coarse =
        local.rotation.conjugate() * coarse_neighbor.rotation;
    rotations.push_back(coarse->second.rotation *
                        local_from_coarse.conjugate());
    const Eigen::Vector3d center =
        local.TargetOriginInSource() +
        scale * (local_from_coarse * (coarse->second.TargetOriginInSource() -
                                      coarse_neighbor.TargetOriginInSource()));
    for (int axis = 0; axis < 3; ++axis) {
      coordinates[axis].push_back(center(axis));
    }
  }
  return CamFromWorldWithCenter(
      L1MeanRotation(rotations),
      Eigen::Vector3d(Median(coordinates[0]), Median(coordinates[1]),
                      Median(coordinates[2])));
}

RegisteredBy RegisterImage(const RegisterImageOptions& options,
                           image_t image_id, MapperScene* scene) {
  const colmap::Reconstruction& reconstruction = scene->reconstruction;
  const colmap::Image& image = reconstruction.Image(image_id);
  const colmap::Camera& camera = reconstruction.Camera(image.CameraId());
  const PointsInImage points = CollectPoints(*scene, image_id);
  const size_t min_num_inliers = static_cast<size_t>(
      std::ceil(options.min_inlier_ratio * points.pixels.size()));
  std::optional<Rigid3d> coarse;
  std::vector<char> coarse_mask;
  if (options.use_global_candidate) {
    coarse = ComputeGlobalCandidate(*scene, image_id);
  }
  if (coarse) {
    coarse_mask =
        FindInliers(points, camera, *coarse, options.max_reproj_error_px);
  }
  const size_t num_coarse_inliers = CountInliers(coarse_mask);
  if (num_coarse_inliers < kEnoughInlierRatio * points.pixels.size() &&
      scene->mapper.RegisterNextImage(image_id, options.max_reproj_error_px,
                                      kMinNumP3pInliers)) {
    const size_t num_inliers = CountInliers(FindInliers(
        points, camera, CamFromWorld(image), options.max_reproj_error_px));
    if (num_inliers > num_coarse_inliers && num_inliers >= min_num_inliers) {
      return RegisteredBy::kP3p;
    }
    scene->mapper.Deregister(image_id);
  }
  if (num_coarse_inliers <
      std::max<size_t>(options.min_num_visible_points, min_num_inliers)) {
    return RegisteredBy::kNone;
  }
  RefinePose(points, coarse_mask, camera, &*coarse);
  scene->mapper.Register(image_id, *coarse);
  return RegisteredBy::kGlobalPose;
}

}  // namespace adasfm
