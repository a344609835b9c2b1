// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/triangulate_tracks.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// One observation under its known pose.
struct Ray {
  TrackElement element;
  const Bearing* bearing = nullptr;
  const Rigid3d* cam_from_world = nullptr;
  Eigen::Vector3d origin;     // in the world
  Eigen::Vector3d direction;  // in the world
};

std::vector<Ray> CollectRays(
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const Track& track) {
  std::vector<Ray> rays;
  for (const TrackElement& element : track) {
    const auto pose = cams_from_world.find(element.image_id);
    if (pose == cams_from_world.end()) continue;
    Ray ray;
    ray.element = element;
    ray.bearing = &bearings.at(element.image_id).at(element.point2D_idx);
    ray.cam_from_world = &pose->second;
    ray.origin = pose->second.TargetOriginInSource();
    ray.direction = pose->second.rotation.conjugate() * ray.bearing->direction;
    rays.push_back(ray);
  }
  return rays;
}

// Distance in the image between the keypoint and the point, in px. The point's
// ray differs from the keypoint's by a vector that the Jacobian's pseudo-
// inverse takes to pixels. Infinite for points behind the camera.
double ReprojectionError(const Ray& ray, const Eigen::Vector3d& point) {
  const Eigen::Vector3d in_cam = *ray.cam_from_world * point;
  const double cosine = in_cam.dot(ray.bearing->direction) / in_cam.norm();
  // Behind, or so far off that the linearisation means nothing.
  if (!(cosine > 0.5)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d offset =
      in_cam / (in_cam.norm() * cosine) - ray.bearing->direction;
  const Eigen::Matrix<double, 3, 2>& jacobian = ray.bearing->jacobian;
  const Eigen::Vector2d pixels = (jacobian.transpose() * jacobian)
                                     .ldlt()
                                     .solve(jacobian.transpose() * offset);
  return pixels.norm();
}

// The point nearest to the rays of a set, weighted; none when they are
// (nearly) parallel.
std::optional<Eigen::Vector3d> IntersectRays(
    const std::vector<Ray>& rays, const std::vector<int>& set,
    const std::vector<double>& weights) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < set.size(); ++k) {
    const Ray& ray = rays[set[k]];
    const Eigen::Matrix3d across =
        weights[k] * (Eigen::Matrix3d::Identity() -
                      ray.direction * ray.direction.transpose());
    matrix += across;
    right_side += across * ray.origin;
  }
  const Eigen::Vector3d point = matrix.ldlt().solve(right_side);
  if (!point.allFinite()) return std::nullopt;
  return point;
}

std::vector<int> FindAgreeing(const std::vector<Ray>& rays,
                              const Eigen::Vector3d& point,
                              double max_error_px) {
  std::vector<int> agreeing;
  for (size_t k = 0; k < rays.size(); ++k) {
    if (ReprojectionError(rays[k], point) <= max_error_px) {
      agreeing.push_back(k);
    }
  }
  return agreeing;
}

// The rays that agree with the best point of two rays. All pairs of short
// tracks, an even subset of pairs of long ones.
std::vector<int> FindConsensus(const std::vector<Ray>& rays,
                               double max_error_px) {
  constexpr size_t kMaxNumEnds = 8;
  std::vector<int> ends;
  const size_t num_ends = std::min(rays.size(), kMaxNumEnds);
  for (size_t k = 0; k < num_ends; ++k) {
    ends.push_back(num_ends < 2 ? 0 : k * (rays.size() - 1) / (num_ends - 1));
  }
  std::vector<int> best;
  // Distant pairs first: their points are the most certain.
  for (size_t gap = num_ends - 1; gap >= 1; --gap) {
    for (size_t k = 0; k + gap < num_ends; ++k) {
      const std::vector<int> pair = {ends[k], ends[k + gap]};
      const auto point = IntersectRays(rays, pair, {1.0, 1.0});
      if (!point.has_value()) continue;
      std::vector<int> agreeing = FindAgreeing(rays, *point, max_error_px);
      if (agreeing.size() > best.size()) best = std::move(agreeing);
      if (best.size() == rays.size()) return best;
    }
  }
  return best;
}

double MaxAngleRad(const std::vector<Ray>& rays, const std::vector<int>& set) {
  double max_angle_rad = 0.0;
  for (size_t a = 0; a < set.size(); ++a) {
    for (size_t b = a + 1; b < set.size(); ++b) {
      max_angle_rad = std::max(
          max_angle_rad,
          AngleBetweenRad(rays[set[a]].direction, rays[set[b]].direction));
    }
  }
  return max_angle_rad;
}

// Rays have weights of their inverse squared length, for angular errors.
std::optional<Eigen::Vector3d> RefinePoint(const std::vector<Ray>& rays,
                                           const std::vector<int>& set) {
  auto point = IntersectRays(rays, set, std::vector<double>(set.size(), 1.0));
  constexpr int kNumRounds = 2;
  for (int i = 0; i < kNumRounds && point.has_value(); ++i) {
    std::vector<double> weights;
    for (const int k : set) {
      weights.push_back(
          1.0 / std::max(1e-12, (*point - rays[k].origin).squaredNorm()));
    }
    // Makes the largest weight one, for ldlt.
    const double sum = *std::max_element(weights.begin(), weights.end());
    for (double& weight : weights) weight /= sum;
    point = IntersectRays(rays, set, weights);
  }
  return point;
}

std::optional<TriangulatedTrack> TriangulateTrack(
    const TrackTriangulationOptions& options, const std::vector<Ray>& rays) {
  const auto is_short = [](size_t length) {
    return static_cast<int>(length) < kMinNumTrackImages;
  };
  if (is_short(rays.size())) return std::nullopt;
  std::vector<int> agreeing = FindConsensus(rays, options.max_reproj_error_px);
  if (is_short(agreeing.size())) return std::nullopt;
  const auto point = RefinePoint(rays, agreeing);
  if (!point.has_value()) return std::nullopt;
  agreeing = FindAgreeing(rays, *point, options.max_reproj_error_px);
  if (is_short(agreeing.size())) return std::nullopt;
  const double angle_deg = RadToDeg(MaxAngleRad(rays, agreeing));
  if (angle_deg < options.min_triangulation_angle_deg) return std::nullopt;

  TriangulatedTrack result;
  result.point_in_world = *point;
  result.angle_deg = angle_deg;
  for (const int k : agreeing) {
    result.track.push_back(rays[k].element);
    result.mean_reproj_error_px +=
        ReprojectionError(rays[k], *point) / agreeing.size();
  }
  return result;
}

}  // namespace

bool TrackTriangulationOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .NotNegative(
          {{"min_triangulation_angle_deg", min_triangulation_angle_deg}})
      .Positive({{"max_reproj_error_px", max_reproj_error_px}})
      .AllHold();
}

std::vector<TriangulatedTrack> TriangulateTracks(
    const TrackTriangulationOptions& options,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const std::vector<Track>& tracks) {
  std::vector<std::optional<TriangulatedTrack>> slots(tracks.size());
  ParallelFor(options.num_threads, tracks.size(), [&](size_t k) {
    slots[k] = TriangulateTrack(
        options, CollectRays(cams_from_world, bearings, tracks[k]));
  });
  std::vector<TriangulatedTrack> triangulated;
  for (auto& slot : slots) {
    if (slot.has_value()) triangulated.push_back(std::move(*slot));
  }
  return triangulated;
}

}  // namespace adasfm
