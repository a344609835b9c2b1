// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/merge_reconstructions.h"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/register_image.h"
#include "core/disjoint_sets.h"

namespace adasfm {
namespace {

// Largest error of an observation at the start; the refinement filters.
constexpr double kMaxInitialErrorPx = 30.0;

using Observation = std::pair<image_t, point2D_t>;

// A point of one part, in the world frame.
struct PartPoint {
  Eigen::Vector3d xyz_in_world;
  std::vector<Observation> observations;
};

std::vector<PartPoint> CollectPoints(const AlignPartsResult& aligned,
                                     const std::vector<PartModel>& parts) {
  std::vector<PartPoint> points;
  for (size_t k = 0; k < parts.size(); ++k) {
    if (!aligned.alignments[k].success) continue;
    const auto& points3D = parts[k].reconstruction.Points3D();
    std::vector<colmap::point3D_t> ids;
    for (const auto& [id, point3D] : points3D) ids.push_back(id);
    std::sort(ids.begin(), ids.end());
    for (const colmap::point3D_t id : ids) {
      const colmap::Point3D& point3D = points3D.at(id);
      PartPoint point;
      point.xyz_in_world = aligned.world_from_parts[k] * XyzOf(point3D);
      for (const auto& element : TrackOf(point3D).Elements()) {
        point.observations.emplace_back(element.image_id, element.point2D_idx);
      }
      std::sort(point.observations.begin(), point.observations.end());
      points.push_back(std::move(point));
    }
  }
  return points;
}

// The groups of points that share observations, as lists of indices.
std::vector<std::vector<size_t>> GroupPoints(
    const std::vector<PartPoint>& points) {
  DisjointSets sets(points.size());
  std::vector<std::pair<Observation, size_t>> point_of;
  for (size_t i = 0; i < points.size(); ++i) {
    for (const Observation& observation : points[i].observations) {
      point_of.emplace_back(observation, i);
    }
  }
  std::sort(point_of.begin(), point_of.end());
  for (size_t k = 1; k < point_of.size(); ++k) {
    if (point_of[k].first != point_of[k - 1].first) continue;
    const int a = sets.Find(point_of[k - 1].second);
    const int b = sets.Find(point_of[k].second);
    sets.Join(std::max(a, b), std::min(a, b));
  }
  std::vector<std::vector<size_t>> groups(points.size());
  for (size_t i = 0; i < points.size(); ++i) groups[sets.Find(i)].push_back(i);
  groups.erase(std::remove_if(groups.begin(), groups.end(),
                              [](const auto& group) { return group.empty(); }),
               groups.end());
  return groups;
}

class Merger {
 public:
  Merger(const AlignPartsResult& aligned, const std::vector<PartModel>& parts,
         MapperScene* scene)
      : aligned_(aligned), parts_(parts), scene_(*scene) {}

  MergeSummary Run() {
    RegisterByParts();
    RegisterByCoarsePoses();
    const std::vector<PartPoint> points = CollectPoints(aligned_, parts_);
    for (const std::vector<size_t>& group : GroupPoints(points)) {
      AddPoint(points, group);
    }
    return summary_;
  }

 private:
  void RegisterByParts() {
    // The most points with which a part has registered the image; 0 where only
    // priors did.
    std::map<image_t, std::pair<int, size_t>> best;
    for (size_t k = 0; k < parts_.size(); ++k) {
      if (!aligned_.alignments[k].success) continue;
      for (const image_t image_id : parts_[k].reconstruction.RegImageIds()) {
        if (!scene_.images.count(image_id)) continue;
        const int num_points =
            parts_[k].prior_only_images.count(image_id)
                ? 0
                : parts_[k].reconstruction.Image(image_id).NumPoints3D();
        const auto [it, is_new] =
            best.emplace(image_id, std::make_pair(num_points, k));
        if (!is_new && num_points > it->second.first) {
          it->second = {num_points, k};
        }
      }
    }
    for (const auto& [image_id, choice] : best) {
      const auto& [num_points, k] = choice;
      scene_.mapper.Register(
          image_id,
          TransformCamFromWorld(
              aligned_.world_from_parts[k],
              CamFromWorld(parts_[k].reconstruction.Image(image_id))));
      if (num_points == 0) summary_.coarse_images.insert(image_id);
    }
  }

  void RegisterByCoarsePoses() {
    // From the registered images outwards: they may have moved away from their
    // coarse poses.
    bool grew = true;
    while (grew) {
      grew = false;
      for (const auto& [image_id, coarse_pose] : *scene_.coarse) {
        if (!scene_.images.count(image_id) ||
            IsRegistered(scene_.reconstruction, image_id)) {
          continue;
        }
        const auto pose = ComputeGlobalCandidate(scene_, image_id);
        if (!pose) continue;
        scene_.mapper.Register(image_id, *pose);
        summary_.coarse_images.insert(image_id);
        grew = true;
      }
    }
    for (const auto& [image_id, coarse_pose] : *scene_.coarse) {
      if (!scene_.images.count(image_id) ||
          IsRegistered(scene_.reconstruction, image_id)) {
        continue;
      }
      scene_.mapper.Register(image_id, coarse_pose);
      summary_.coarse_images.insert(image_id);
    }
  }

  // One keypoint for each image, by majority of the points.
  std::vector<Observation> Vote(const std::vector<PartPoint>& points,
                                const std::vector<size_t>& group) const {
    std::map<Observation, int> votes;
    for (const size_t i : group) {
      for (const Observation& observation : points[i].observations) {
        if (scene_.images.count(observation.first)) ++votes[observation];
      }
    }
    std::map<image_t, std::pair<int, point2D_t>> winners;
    for (const auto& [observation, num_votes] : votes) {
      auto& winner = winners[observation.first];
      if (num_votes > winner.first) winner = {num_votes, observation.second};
    }
    std::vector<Observation> observations;
    for (const auto& [image_id, winner] : winners) {
      observations.emplace_back(image_id, winner.second);
    }
    return observations;
  }

  double ComputeErrorPx(const Eigen::Vector3d& xyz,
                        const Observation& observation) const {
    const colmap::Image& image = scene_.reconstruction.Image(observation.first);
    const Eigen::Vector3d point_in_cam = CamFromWorld(image) * xyz;
    if (point_in_cam.z() < 1e-6) return std::numeric_limits<double>::max();
    return (PixelFromPlane(scene_.reconstruction.Camera(image.CameraId()),
                           point_in_cam.hnormalized()) -
            XyOf(image.Point2D(observation.second)))
        .norm();
  }

  void AddPoint(const std::vector<PartPoint>& points,
                const std::vector<size_t>& group) {
    const std::vector<Observation> observations = Vote(points, group);
    double best_cost = std::numeric_limits<double>::max();
    Eigen::Vector3d best_xyz = points[group[0]].xyz_in_world;
    for (const size_t i : group) {
      if (group.size() == 1) break;
      double cost = 0.0;
      for (const Observation& observation : observations) {
        cost += std::min(kMaxInitialErrorPx,
                         ComputeErrorPx(points[i].xyz_in_world, observation));
      }
      if (cost < best_cost) {
        best_cost = cost;
        best_xyz = points[i].xyz_in_world;
      }
    }
    colmap::Track track;
    for (const Observation& observation : observations) {
      if (IsRegistered(scene_.reconstruction, observation.first) &&
          !scene_.reconstruction.Image(observation.first)
               .Point2D(observation.second)
               .HasPoint3D() &&
          ComputeErrorPx(best_xyz, observation) <= kMaxInitialErrorPx) {
        track.AddElement(observation.first, observation.second);
      }
    }
    if (track.Length() < 2) return;
    scene_.mapper.AddPoint(best_xyz, track);
    ++summary_.num_points;
    summary_.num_merged_points += static_cast<int>(group.size()) - 1;
  }

  const AlignPartsResult& aligned_;
  const std::vector<PartModel>& parts_;
  MapperScene& scene_;
  MergeSummary summary_;
};

}  // namespace

MergeSummary MergeParts(const AlignPartsResult& aligned,
                        const std::vector<PartModel>& parts,
                        MapperScene* scene) {
  return Merger(aligned, parts, scene).Run();
}

}  // namespace adasfm
