// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/image_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/parallel.h"
#include "core/so3.h"
#include "synthetic/pair_candidates.h"
#include "synthetic/two_view_refinement.h"

namespace adasfm {
namespace {

// COLMAP keeps pairs with at least so many verified matches.
constexpr int kMinNumInliers = 15;
constexpr double kMaxEpipolarErrorPx = 4.0;
// A feature is recognised between views that do not differ by more.
constexpr double kMaxScaleRatio = 2.2;
constexpr double kMatchRate = 0.85;
// Look-alike facades are not equal in all details.
constexpr double kAliasMatchRate = 0.4;

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
  std::optional<SyntheticPair> Match(const PairCandidate& candidate) const {
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
  std::vector<FeatureMatch> MatchLandmarks(const PairCandidate& candidate,
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
  void AddOutliers(const PairCandidate& candidate, Random* random,
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

void MatchAll(const Matcher& matcher,
              const std::vector<PairCandidate>& candidates,
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
  int num_found = 0;
  for (const PairCandidate& candidate : FindAliases(grid, world, &random)) {
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
  std::vector<PairCandidate> candidates = FindSequentialPairs(*world);
  const std::vector<PairCandidate> revisits =
      FindRevisits(*world, arc_lengths_m);
  candidates.insert(candidates.end(), revisits.begin(), revisits.end());
  std::map<ImagePair, SyntheticPair> pairs;
  MatchAll(matcher, AddSecondCamera(*world, std::move(candidates)), &pairs);
  MatchAliases(matcher, grid, *world, &pairs);
  for (auto& [key, pair] : pairs) world->pairs.push_back(std::move(pair));
}

}  // namespace adasfm
