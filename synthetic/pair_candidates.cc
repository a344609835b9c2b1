// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/pair_candidates.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "synthetic/landmarks.h"

namespace adasfm {
namespace {

// Images count as taken on another visit when the car has driven this far
// between them.
constexpr double kRevisitDistance = 75.0;
constexpr double kRevisitRadius = 15.0;
constexpr size_t kMaxNumRevisitsPerImage = 10;
// Images of aliased pairs differ by less than this along their streets, and are
// farther apart than this in the world [m].
constexpr double kMaxAliasOffset = 8.0;
constexpr double kMinAliasDistance = 45.0;
constexpr size_t kNumAliasNeighbors = 5;
constexpr size_t kAliasRunLength = 14;

// How far the car has driven between two visits.
double RevisitDistance(const SyntheticWorldOptions& options) {
  return IsOnLawn(options) ? options.lane_length_m : kRevisitDistance;
}

double MinAliasDistance(const SyntheticWorldOptions& options) {
  return options.trajectory == SyntheticTrajectory::kFloors
             ? 0.8 * options.floor_height_m
             : kMinAliasDistance;
}

PairCandidate TrueCandidate(const SyntheticWorld& world, int first,
                            int second) {
  return {first, second, -1, -1, world.images[second].cam_from_world};
}

// The images in a street, driven in the street's direction: (u, image).
std::vector<std::pair<double, int>> ImagesInStreet(const SyntheticWorld& world,
                                                   const Street& street) {
  std::vector<std::pair<double, int>> images;
  for (int i = 0; i < world.options.num_images; ++i) {
    const Rigid3d& pose = world.images[i].cam_from_world;
    const Eigen::Vector3d uvz =
        street.LocalFromWorld(pose.TargetOriginInSource());
    const Eigen::Vector3d forward =
        pose.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    if (uvz.x() > -10.0 && uvz.x() < kBlockSize && std::abs(uvz.y()) < 3.0 &&
        std::abs(uvz.z() - kCameraHeight) < kCameraHeight &&
        forward.head<2>().dot(street.Direction()) > 0.9) {
      images.emplace_back(uvz.x(), i);
    }
  }
  return images;
}

// The apparent pose of a camera when the street is mistaken for its twin.
Rigid3d MoveToTwin(const Rigid3d& cam_from_world, const Street& street,
                   const Street& twin) {
  const Eigen::Vector3d center = twin.WorldFromLocal(
      street.LocalFromWorld(cam_from_world.TargetOriginInSource()));
  const Eigen::Vector2d from = street.Direction();
  const Eigen::Vector2d to = twin.Direction();
  const double turn =
      std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
  const Eigen::Quaterniond street_from_twin(
      Eigen::AngleAxisd(-turn, Eigen::Vector3d::UnitZ()));
  return CamFromWorldWithCenter(cam_from_world.rotation * street_from_twin,
                                center);
}

// Candidates of one pair of twins: a run of neighbouring images, and all
// others.
void FindTwinAliases(const StreetGrid& grid, const SyntheticWorld& world,
                     int street_index, int twin_index, Random* random,
                     std::vector<PairCandidate>* run,
                     std::vector<PairCandidate>* rest) {
  const Street& street = grid.streets[street_index];
  const Street& twin = grid.streets[twin_index];
  const auto here = ImagesInStreet(world, street);
  const auto there = ImagesInStreet(world, twin);
  if (here.empty() || there.empty()) return;
  const size_t begin = random->UniformInt(
      0, std::max<int64_t>(0, here.size() - kAliasRunLength));
  for (size_t k = 0; k < here.size(); ++k) {
    const auto& [u, image] = here[k];
    std::vector<std::pair<double, int>> near;
    for (const auto& [other_u, other] : there) {
      const double distance =
          (world.images[image].cam_from_world.TargetOriginInSource() -
           world.images[other].cam_from_world.TargetOriginInSource())
              .norm();
      if (std::abs(other_u - u) < kMaxAliasOffset &&
          distance > MinAliasDistance(world.options)) {
        near.emplace_back(std::abs(other_u - u), other);
      }
    }
    std::sort(near.begin(), near.end());
    for (size_t rank = 0; rank < near.size(); ++rank) {
      const int other = near[rank].second;
      // Image 1 is the earlier one; camera 2 appears to be in the street of
      // camera 1.
      const bool is_first_here = image < other;
      PairCandidate candidate{std::min(image, other), std::max(image, other),
                              is_first_here ? street_index : twin_index,
                              is_first_here ? twin_index : street_index,
                              Rigid3d()};
      candidate.apparent_cam2_from_world = MoveToTwin(
          world.images[candidate.second].cam_from_world,
          is_first_here ? twin : street, is_first_here ? street : twin);
      const bool in_run = (IsPeriodic(world.options) ||
                           (k >= begin && k < begin + kAliasRunLength)) &&
                          rank < kNumAliasNeighbors;
      (in_run ? run : rest)->push_back(candidate);
    }
  }
}

}  // namespace

std::vector<PairCandidate> FindSequentialPairs(const SyntheticWorld& world) {
  std::vector<PairCandidate> candidates;
  const int num_images = world.options.num_images;
  for (int i = 0; i < num_images; ++i) {
    const int end =
        std::min(num_images, i + world.options.num_sequential_neighbors + 1);
    for (int j = i + 1; j < end; ++j) {
      candidates.push_back(TrueCandidate(world, i, j));
    }
  }
  return candidates;
}

std::vector<PairCandidate> AddSecondCamera(
    const SyntheticWorld& world, std::vector<PairCandidate> candidates) {
  const int num_frames = world.options.num_images;
  if (static_cast<int>(world.images.size()) == num_frames) return candidates;
  const size_t num_of_first = candidates.size();
  for (size_t k = 0; k < num_of_first; ++k) {
    const int first = candidates[k].first;
    const int second = candidates[k].second + num_frames;
    candidates.push_back(TrueCandidate(world, first, second));
    candidates.push_back(TrueCandidate(world, first + num_frames, second));
  }
  for (int i = 0; i < num_frames; ++i) {
    candidates.push_back(TrueCandidate(world, i, i + num_frames));
  }
  return candidates;
}

std::vector<PairCandidate> FindRevisits(
    const SyntheticWorld& world, const std::vector<double>& arc_lengths_m) {
  std::map<std::pair<int, int>, std::vector<int>> cells;
  const auto cell = [](const Eigen::Vector3d& center) {
    return std::make_pair<int, int>(std::floor(center.x() / kRevisitRadius),
                                    std::floor(center.y() / kRevisitRadius));
  };
  const double min_way_m = RevisitDistance(world.options);
  std::vector<PairCandidate> candidates;
  for (int i = 0; i < world.options.num_images; ++i) {
    const Rigid3d& pose = world.images[i].cam_from_world;
    const Eigen::Vector3d center = pose.TargetOriginInSource();
    const auto [column, row] = cell(center);
    std::vector<std::pair<double, int>> near;
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (const int j : cells[{column + dx, row + dy}]) {
          const Rigid3d& other = world.images[j].cam_from_world;
          const double distance =
              (center - other.TargetOriginInSource()).norm();
          if (arc_lengths_m[i] - arc_lengths_m[j] > min_way_m &&
              distance < kRevisitRadius &&
              AngleBetweenRad(pose.rotation, other.rotation) < kMaxViewAngle) {
            near.emplace_back(distance, j);
          }
        }
      }
    }
    std::sort(near.begin(), near.end());
    if (near.size() > kMaxNumRevisitsPerImage) {
      near.resize(kMaxNumRevisitsPerImage);
    }
    for (const auto& [distance, j] : near) {
      candidates.push_back(TrueCandidate(world, j, i));
    }
    cells[{column, row}].push_back(i);
  }
  return candidates;
}

std::vector<PairCandidate> FindAliases(const StreetGrid& grid,
                                       const SyntheticWorld& world,
                                       Random* random) {
  std::vector<PairCandidate> runs, rest;
  const int num_streets = static_cast<int>(grid.streets.size());
  for (int i = 0; i < num_streets; ++i) {
    if (!grid.streets[i].is_driven || grid.streets[i].twin < 0) continue;
    for (int j = i + 1; j < num_streets; ++j) {
      if (!grid.streets[j].is_driven ||
          grid.streets[j].layout_seed != grid.streets[i].layout_seed) {
        continue;
      }
      FindTwinAliases(grid, world, i, j, random, &runs, &rest);
    }
  }
  runs.insert(runs.end(), rest.begin(), rest.end());
  if (IsPeriodic(world.options)) {
    random->Shuffle(&runs);
  }
  return runs;
}

}  // namespace adasfm
