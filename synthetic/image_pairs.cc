// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/image_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "core/parallel.h"
#include "core/so3.h"
#include "synthetic/two_view_refinement.h"

namespace adasfm {
namespace {

// COLMAP keeps pairs with at least so many verified matches.
constexpr int kMinNumInliers = 15;
constexpr double kMaxEpipolarErrorPx = 4.0;
// A feature is recognised between views that do not differ by more.
constexpr double kMaxViewAngle = DegToRad(35.0);
constexpr double kMaxScaleRatio = 2.2;
constexpr double kMatchRate = 0.85;
// Look-alike facades are not equal in all details.
constexpr double kAliasMatchRate = 0.4;
// Images count as taken on another visit when the car has driven this far
// between them.
constexpr double kRevisitDistance = 75.0;
constexpr double kRevisitRadius = 15.0;
constexpr size_t kMaxNumRevisitsPerImage = 10;
// Look-alike images are this close to each other, relative to their facades,
// and at least that far apart in truth.
constexpr double kMaxAliasOffset = 8.0;
constexpr double kMinAliasDistance = 45.0;
constexpr size_t kNumAliasNeighbors = 5;
constexpr size_t kAliasRunLength = 14;

struct Candidate {
  int first, second;
  bool is_alias = false;
  // Where camera 2 seems to be: its pose relative to the landmarks that look
  // like those which camera 1 sees. The true one unless is_alias.
  Rigid3d apparent_cam2_from_world;
};

class Matcher {
 public:
  Matcher(const LandmarkMap& map, const SyntheticWorld& world)
      : map_(map),
        world_(world),
        indices_(world.images.size()),
        bearings_(world.images.size()) {
    ParallelFor(-1, world.images.size(), [&](size_t i) {
      const SyntheticImage& image = world_.images[i];
      bearings_[i] = ComputeBearings(world_.camera, image);
      for (size_t k = 0; k < image.landmark_ids.size(); ++k) {
        indices_[i].emplace_back(image.landmark_ids[k], k);
      }
      std::sort(indices_[i].begin(), indices_[i].end());
    });
  }

  // Nothing when too few matches survive verification.
  std::optional<SyntheticPair> Match(const Candidate& candidate) const {
    const SyntheticImage& image1 = world_.images[candidate.first];
    const SyntheticImage& image2 = world_.images[candidate.second];
    if (image1.keypoints.empty() || image2.keypoints.empty()) return {};
    Random random =
        MakeRandom(world_.options.seed, 10 + image1.image_id, image2.image_id);
    SyntheticPair pair;
    pair.image_id1 = image1.image_id;
    pair.image_id2 = image2.image_id;
    pair.is_alias = candidate.is_alias;
    const std::vector<FeatureMatch> shared = MatchLandmarks(candidate, &random);
    if (static_cast<int>(shared.size()) < kMinNumInliers) return {};
    pair.raw_matches = shared;
    AddOutliers(candidate, &random, &pair.raw_matches);

    Rigid3d apparent = ComputeCam2FromCam1(image1.cam_from_world,
                                           candidate.apparent_cam2_from_world);
    // Without motion the direction is anybody's guess.
    if (apparent.translation.norm() < 1e-9) {
      apparent.translation = random.UnitVector();
    }
    const std::vector<Bearing>& bearings1 = bearings_[candidate.first];
    const std::vector<Bearing>& bearings2 = bearings_[candidate.second];
    pair.cam2_from_cam1 =
        RefineTwoViewPose(bearings1, bearings2, shared, apparent);
    for (const FeatureMatch& match : pair.raw_matches) {
      if (ComputeSampsonErrorPx(bearings1[match.point2D_idx1],
                                bearings2[match.point2D_idx2],
                                pair.cam2_from_cam1) <= kMaxEpipolarErrorPx) {
        pair.inlier_matches.push_back(match);
      }
    }
    if (static_cast<int>(pair.inlier_matches.size()) < kMinNumInliers) {
      return {};
    }
    return pair;
  }

 private:
  std::vector<FeatureMatch> MatchLandmarks(const Candidate& candidate,
                                           Random* random) const {
    std::vector<FeatureMatch> matches;
    const auto& index1 = indices_[candidate.first];
    const auto& index2 = indices_[candidate.second];
    const Eigen::Vector3d center1 =
        world_.images[candidate.first].cam_from_world.TargetOriginInSource();
    const Eigen::Vector3d center2 =
        candidate.apparent_cam2_from_world.TargetOriginInSource();
    for (const auto& [landmark, point1] : index1) {
      const int wanted =
          candidate.is_alias ? map_.landmarks[landmark].twin : landmark;
      if (wanted < 0) continue;
      const auto found = std::lower_bound(index2.begin(), index2.end(),
                                          std::make_pair(wanted, 0));
      if (found == index2.end() || found->first != wanted) continue;
      const Eigen::Vector3d& position =
          map_.landmarks[landmark].position_in_world;
      const double distance1 = (position - center1).norm();
      const double distance2 = (position - center2).norm();
      if (distance1 > kMaxScaleRatio * distance2 ||
          distance2 > kMaxScaleRatio * distance1 ||
          AngleBetweenRad(position - center1, position - center2) >
              kMaxViewAngle) {
        continue;
      }
      const double rate = candidate.is_alias ? kAliasMatchRate : kMatchRate;
      if (random->Uniform(0.0, 1.0) > rate) continue;
      matches.push_back({static_cast<point2D_t>(point1),
                         static_cast<point2D_t>(found->second)});
    }
    return matches;
  }

  // Joins keypoints at random that have no match yet.
  void AddOutliers(const Candidate& candidate, Random* random,
                   std::vector<FeatureMatch>* matches) const {
    std::vector<bool> used1(indices_[candidate.first].size(), false);
    std::vector<bool> used2(indices_[candidate.second].size(), false);
    for (const FeatureMatch& match : *matches) {
      used1[match.point2D_idx1] = true;
      used2[match.point2D_idx2] = true;
    }
    std::vector<point2D_t> free1, free2;
    for (size_t i = 0; i < used1.size(); ++i) {
      if (!used1[i]) free1.push_back(static_cast<point2D_t>(i));
    }
    for (size_t i = 0; i < used2.size(); ++i) {
      if (!used2[i]) free2.push_back(static_cast<point2D_t>(i));
    }
    random->Shuffle(&free1);
    random->Shuffle(&free2);
    const double ratio = world_.options.outlier_match_ratio;
    const size_t num = std::min({static_cast<size_t>(std::lround(
                                     ratio / (1.0 - ratio) * matches->size())),
                                 free1.size(), free2.size()});
    for (size_t i = 0; i < num; ++i) matches->push_back({free1[i], free2[i]});
    std::sort(matches->begin(), matches->end());
  }

  const LandmarkMap& map_;
  const SyntheticWorld& world_;
  // By image: (landmark, keypoint), sorted.
  std::vector<std::vector<std::pair<int, int>>> indices_;
  std::vector<std::vector<Bearing>> bearings_;
};

Candidate TrueCandidate(const SyntheticWorld& world, int first, int second) {
  return {first, second, false, world.images[second].cam_from_world};
}

std::vector<Candidate> FindSequentialPairs(const SyntheticWorld& world) {
  std::vector<Candidate> candidates;
  const int num_images = static_cast<int>(world.images.size());
  for (int i = 0; i < num_images; ++i) {
    const int end =
        std::min(num_images, i + world.options.num_sequential_neighbors + 1);
    for (int j = i + 1; j < end; ++j) {
      candidates.push_back(TrueCandidate(world, i, j));
    }
  }
  return candidates;
}

// Images that stand close together and look the same way, on another visit:
// the nearest earlier ones of each image.
std::vector<Candidate> FindRevisits(const SyntheticWorld& world,
                                    const std::vector<double>& arc_lengths_m) {
  std::map<std::pair<int, int>, std::vector<int>> cells;
  const auto cell = [](const Eigen::Vector3d& center) {
    return std::make_pair<int, int>(std::floor(center.x() / kRevisitRadius),
                                    std::floor(center.y() / kRevisitRadius));
  };
  std::vector<Candidate> candidates;
  for (size_t i = 0; i < world.images.size(); ++i) {
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
          if (arc_lengths_m[i] - arc_lengths_m[j] > kRevisitDistance &&
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
      candidates.push_back(TrueCandidate(world, j, static_cast<int>(i)));
    }
    cells[{column, row}].push_back(static_cast<int>(i));
  }
  return candidates;
}

// The images in a street, driven in the street's direction: (u, image).
std::vector<std::pair<double, int>> ImagesInStreet(const SyntheticWorld& world,
                                                   const Street& street) {
  std::vector<std::pair<double, int>> images;
  for (size_t i = 0; i < world.images.size(); ++i) {
    const Rigid3d& pose = world.images[i].cam_from_world;
    const Eigen::Vector3d uvz =
        street.LocalFromWorld(pose.TargetOriginInSource());
    const Eigen::Vector3d forward =
        pose.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    if (uvz.x() > -10.0 && uvz.x() < kBlockSize && std::abs(uvz.y()) < 3.0 &&
        forward.head<2>().dot(street.Direction()) > 0.9) {
      images.emplace_back(uvz.x(), static_cast<int>(i));
    }
  }
  return images;
}

// The pose that camera sees itself in when it takes the street for its twin.
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

// Candidates of one pair of twins, a run of neighbouring images first.
void FindAliases(const SyntheticWorld& world, const Street& street,
                 const Street& twin, Random* random,
                 std::vector<Candidate>* run, std::vector<Candidate>* rest) {
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
          distance > kMinAliasDistance) {
        near.emplace_back(std::abs(other_u - u), other);
      }
    }
    std::sort(near.begin(), near.end());
    for (size_t rank = 0; rank < near.size(); ++rank) {
      const int other = near[rank].second;
      // Camera 1 is the earlier image, and camera 2 sees itself in its street.
      Candidate candidate{std::min(image, other), std::max(image, other), true,
                          Rigid3d()};
      const bool is_first_here = candidate.first == image;
      candidate.apparent_cam2_from_world = MoveToTwin(
          world.images[candidate.second].cam_from_world,
          is_first_here ? twin : street, is_first_here ? street : twin);
      const bool in_run = k >= begin && k < begin + kAliasRunLength &&
                          rank < kNumAliasNeighbors;
      (in_run ? run : rest)->push_back(candidate);
    }
  }
}

void MatchAll(const Matcher& matcher, const std::vector<Candidate>& candidates,
              std::map<ImagePair, SyntheticPair>* pairs) {
  std::vector<std::optional<SyntheticPair>> matched(candidates.size());
  ParallelFor(-1, candidates.size(),
              [&](size_t i) { matched[i] = matcher.Match(candidates[i]); });
  for (std::optional<SyntheticPair>& pair : matched) {
    if (!pair) continue;
    const ImagePair key(pair->image_id1, pair->image_id2);
    pairs->emplace(key, std::move(*pair));
  }
}

// Look-alike pairs until they make up the share asked for.
void MatchAliases(const Matcher& matcher, const StreetGrid& grid,
                  const SyntheticWorld& world,
                  std::map<ImagePair, SyntheticPair>* pairs) {
  const double ratio = world.options.alias_pair_ratio;
  const int num_wanted =
      static_cast<int>(std::lround(ratio / (1.0 - ratio) * pairs->size()));
  Random random = MakeRandom(world.options.seed, 11);
  std::vector<Candidate> runs, rest;
  for (size_t i = 0; i < grid.streets.size(); ++i) {
    const int twin = grid.streets[i].twin;
    if (twin < static_cast<int>(i)) continue;
    FindAliases(world, grid.streets[i], grid.streets[twin], &random, &runs,
                &rest);
  }
  runs.insert(runs.end(), rest.begin(), rest.end());
  int num_found = 0;
  for (const Candidate& candidate : runs) {
    if (num_found >= num_wanted) return;
    std::optional<SyntheticPair> pair = matcher.Match(candidate);
    if (!pair) continue;
    const ImagePair key(pair->image_id1, pair->image_id2);
    if (pairs->emplace(key, std::move(*pair)).second) ++num_found;
  }
}

}  // namespace

void MatchImages(const StreetGrid& grid, const LandmarkMap& map,
                 const std::vector<double>& arc_lengths_m,
                 SyntheticWorld* world) {
  const Matcher matcher(map, *world);
  std::vector<Candidate> candidates = FindSequentialPairs(*world);
  const std::vector<Candidate> revisits = FindRevisits(*world, arc_lengths_m);
  candidates.insert(candidates.end(), revisits.begin(), revisits.end());
  std::map<ImagePair, SyntheticPair> pairs;
  MatchAll(matcher, candidates, &pairs);
  MatchAliases(matcher, grid, *world, &pairs);
  for (auto& [key, pair] : pairs) world->pairs.push_back(std::move(pair));
}

}  // namespace adasfm
