// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/register_image.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// More co-visible images hardly move a median.
constexpr size_t kMaxNumNeighbors = 15;

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
    if (scene.reconstruction.IsImageRegistered(candidate) &&
        scene.coarse->count(candidate) && seen.insert(candidate).second) {
      neighbors.push_back(candidate);
    }
  }
  return neighbors;
}

// Local lengths over coarse lengths between the neighbours, 1 when they stand
// still.
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

PointsInImage CollectPoints(const MapperScene& scene, image_t image_id) {
  PointsInImage points;
  const colmap::Image& image = scene.reconstruction.Image(image_id);
  for (const VisiblePoint& visible : FindVisiblePoints(scene, image_id)) {
    points.pixels.push_back(image.Point2D(visible.point2D_idx).XY());
    points.points_in_world.push_back(
        scene.reconstruction.Point3D(visible.point3D_id).XYZ());
  }
  return points;
}

int CountInliers(const std::vector<char>& mask) {
  return static_cast<int>(std::count(mask.begin(), mask.end(), 1));
}

}  // namespace

std::vector<char> FindReprojectionInliers(const PointsInImage& points,
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
        camera.WorldToImage(point_in_cam.hnormalized());
    mask[i] = (pixel - points.pixels[i]).norm() <= max_error_px;
  }
  return mask;
}

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

RegisterImageResult EstimateImagePose(const RegisterImageOptions& options,
                                      const MapperScene& scene,
                                      image_t image_id) {
  RegisterImageResult result;
  const PointsInImage points = CollectPoints(scene, image_id);
  result.num_visible_points = static_cast<int>(points.pixels.size());
  if (result.num_visible_points < options.min_num_visible_points) return result;
  const colmap::Camera& camera = scene.reconstruction.Camera(
      scene.reconstruction.Image(image_id).CameraId());
  std::vector<char> best_mask;
  const auto consider = [&](const std::optional<Rigid3d>& candidate,
                            RegisteredBy registered_by) {
    if (!candidate) return;
    std::vector<char> mask = FindReprojectionInliers(
        points, camera, *candidate, options.max_reproj_error_px);
    const int num_inliers = CountInliers(mask);
    if (num_inliers <= result.num_inliers) return;
    result.num_inliers = num_inliers;
    result.registered_by = registered_by;
    result.cam_from_world = *candidate;
    best_mask = std::move(mask);
  };
  if (options.use_global_candidate) {
    consider(ComputeGlobalCandidate(scene, image_id),
             RegisteredBy::kGlobalPose);
  }
  consider(EstimatePoseByP3p(points, camera, options.max_reproj_error_px),
           RegisteredBy::kP3p);
  const int min_num_inliers = result.registered_by == RegisteredBy::kP3p
                                  ? options.min_num_p3p_inliers
                                  : options.min_num_visible_points;
  if (result.num_inliers <
      std::max(1.0 * min_num_inliers,
               options.min_inlier_ratio * result.num_visible_points)) {
    result.registered_by = RegisteredBy::kNone;
    return result;
  }
  RefinePose(points, best_mask, camera, &result.cam_from_world);
  return result;
}

}  // namespace adasfm
