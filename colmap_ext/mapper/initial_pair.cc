// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/initial_pair.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "colmap_ext/scene/pairs_among.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Required parallaxes; the first one that any pair reaches is used. The coarse
// poses give the parallax of every match, so a drive straight ahead, with
// little parallax, begins with its best pair.
constexpr double kMinParallaxesDeg[] = {6.0, 3.0, 1.5, 0.75};

using Directions = std::vector<Eigen::Vector3d>;

Directions ComputeDirections(const SceneData& data, image_t image_id) {
  const SceneImage& image = data.images.at(image_id);
  const colmap::Camera& camera = data.cameras.at(image.camera_id);
  Directions directions;
  directions.reserve(image.keypoints.size());
  for (const Eigen::Vector2d& keypoint : image.keypoints) {
    directions.push_back(
        PlaneFromPixel(camera, keypoint).homogeneous().normalized());
  }
  return directions;
}

// The parallax of each match that the relative pose explains: near its epipolar
// line and in front of both cameras.
std::vector<double> ComputeParallaxes(const ScenePair& pair,
                                      const Directions& directions1,
                                      const Directions& directions2,
                                      const Rigid3d& cam2_from_cam1,
                                      double max_epipolar_error_rad) {
  std::vector<double> parallaxes;
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  for (const FeatureMatch& match : pair.inlier_matches) {
    if (match.point2D_idx1 >= directions1.size() ||
        match.point2D_idx2 >= directions2.size()) {
      continue;
    }
    const Eigen::Vector3d ray1 =
        cam2_from_cam1.rotation * directions1[match.point2D_idx1];
    const Eigen::Vector3d& ray2 = directions2[match.point2D_idx2];
    const Eigen::Vector3d normal = t.cross(ray1);
    if (normal.norm() < 1e-6 * t.norm()) continue;
    if (std::abs(normal.normalized().dot(ray2)) > max_epipolar_error_rad) {
      continue;
    }
    // depth2 ray2 = depth1 ray1 + t, projected on the two rays.
    const double cosine = ray1.dot(ray2);
    const double denominator = 1.0 - cosine * cosine;
    if (denominator < 1e-10) continue;
    const double depth1 = (cosine * ray2.dot(t) - ray1.dot(t)) / denominator;
    const double depth2 = (ray2.dot(t) - cosine * ray1.dot(t)) / denominator;
    if (depth1 > 0.0 && depth2 > 0.0) {
      parallaxes.push_back(AngleBetweenRad(ray1, ray2));
    }
  }
  std::sort(parallaxes.begin(), parallaxes.end());
  return parallaxes;
}

int CountAbove(const std::vector<double>& sorted_values, double min_value) {
  return static_cast<int>(
      sorted_values.end() -
      std::lower_bound(sorted_values.begin(), sorted_values.end(), min_value));
}

// A pair with the parallaxes under its better relative pose.
struct Candidate {
  InitialPair pair;
  std::vector<double> parallaxes;
};

class CandidateBuilder {
 public:
  CandidateBuilder(double max_epipolar_error_px, const MapperScene& scene)
      : max_epipolar_error_px_(max_epipolar_error_px), scene_(scene) {}

  // False when the coarse model lacks one of the images.
  bool Build(const ScenePair& pair, Candidate* candidate) {
    const auto pose1 = scene_.coarse->find(pair.image_id1);
    const auto pose2 = scene_.coarse->find(pair.image_id2);
    if (pose1 == scene_.coarse->end() || pose2 == scene_.coarse->end()) {
      return false;
    }
    const Rigid3d coarse = ComputeCam2FromCam1(pose1->second, pose2->second);
    candidate->pair.image_id1 = pair.image_id1;
    candidate->pair.image_id2 = pair.image_id2;
    candidate->pair.cam1_from_world = pose1->second;
    candidate->pair.cam2_from_world = pose2->second;
    candidate->parallaxes = Parallaxes(pair, coarse);
    if (!pair.cam2_from_cam1) return true;
    const Rigid3d two_view(pair.cam2_from_cam1->rotation,
                           pair.cam2_from_cam1->translation.normalized() *
                               coarse.translation.norm());
    if (!two_view.translation.allFinite()) return true;
    std::vector<double> parallaxes = Parallaxes(pair, two_view);
    if (parallaxes.size() > candidate->parallaxes.size()) {
      candidate->parallaxes = std::move(parallaxes);
      candidate->pair.cam2_from_world = two_view * pose1->second;
    }
    return true;
  }

 private:
  std::vector<double> Parallaxes(const ScenePair& pair,
                                 const Rigid3d& cam2_from_cam1) {
    const camera_t camera_id = scene_.data->images.at(pair.image_id2).camera_id;
    const double focal_px =
        scene_.data->cameras.at(camera_id).MeanFocalLength();
    return ComputeParallaxes(pair, DirectionsOf(pair.image_id1),
                             DirectionsOf(pair.image_id2), cam2_from_cam1,
                             max_epipolar_error_px_ / focal_px);
  }

  const Directions& DirectionsOf(image_t image_id) {
    const auto it = directions_.find(image_id);
    if (it != directions_.end()) return it->second;
    return directions_[image_id] = ComputeDirections(*scene_.data, image_id);
  }

  const double max_epipolar_error_px_;
  const MapperScene& scene_;
  std::map<image_t, Directions> directions_;
};

}  // namespace

std::vector<InitialPair> FindInitialPairs(double max_epipolar_error_px,
                                          const MapperScene& scene,
                                          size_t max_num_pairs) {
  CandidateBuilder builder(max_epipolar_error_px, scene);
  std::vector<Candidate> candidates;
  std::set<image_t> free_images;
  for (const image_t image_id : scene.images) {
    if (!IsRegistered(scene.reconstruction, image_id)) {
      free_images.insert(image_id);
    }
  }
  for (const ScenePair* pair : FindPairsAmong(*scene.data, free_images)) {
    if (pair->inlier_matches.size() < kMinNumInitialMatches) {
      continue;
    }
    Candidate candidate;
    if (builder.Build(*pair, &candidate)) {
      candidates.push_back(std::move(candidate));
    }
  }
  for (const double min_parallax_deg : kMinParallaxesDeg) {
    std::vector<InitialPair> pairs;
    for (Candidate& candidate : candidates) {
      candidate.pair.num_points =
          CountAbove(candidate.parallaxes, DegToRad(min_parallax_deg));
      if (candidate.pair.num_points >= kMinNumInitialMatches) {
        pairs.push_back(candidate.pair);
      }
    }
    if (pairs.empty()) continue;
    // Stable: ties stay in the order of ids.
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const InitialPair& a, const InitialPair& b) {
                       return a.num_points > b.num_points;
                     });
    if (pairs.size() > max_num_pairs) pairs.resize(max_num_pairs);
    return pairs;
  }
  return {};
}

}  // namespace adasfm
