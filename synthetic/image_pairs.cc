// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/image_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "core/parallel.h"
#include "core/so3.h"
#include "synthetic/false_pairs.h"
#include "synthetic/pair_candidates.h"
#include "synthetic/traffic.h"
#include "synthetic/two_view_refinement.h"

namespace adasfm {
namespace {

// COLMAP keeps pairs with at least this many verified matches.
constexpr int kMinNumInliers = 15;
// Largest ratio of distances from which a feature is recognised in both views.
constexpr double kMaxScaleRatio = 2.2;
constexpr double kMatchRate = 0.85;
// Facades that look alike are not equal in all details.
constexpr double kAliasMatchRate = 0.4;
// No landmark and no car point (car points are negative).
constexpr int kNoTwin = std::numeric_limits<int>::min();

class Matcher {
 public:
  Matcher(const StreetGrid& grid, const LandmarkMap& map,
          const SyntheticWorld& world)
      : grid_(grid),
        map_(map),
        world_(world),
        indices_(world.images.size()),
        bearings_(world.images.size()) {
    ParallelFor(-1, world.images.size(), [&](size_t i) {
      const SyntheticImage& image = world_.images[i];
      bearings_[i] = ComputeBearings(world_.camera, image);
      for (size_t k = 0; k < image.landmark_ids.size(); ++k) {
        const bool is_on_car =
            !image.car_point_ids.empty() && image.car_point_ids[k] >= 0;
        indices_[i].emplace_back(
            is_on_car ? -1 - image.car_point_ids[k] : image.landmark_ids[k], k);
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
    pair.is_alias = candidate.IsAlias();
    std::vector<FeatureMatch> shared = MatchLandmarks(candidate, &random);
    LeaveRoomForOutliers(candidate, &random, &shared);
    if (static_cast<int>(shared.size()) < kMinNumInliers) return {};
    pair.raw_matches = shared;
    AddOutliers(candidate, &random, &pair.raw_matches);

    std::vector<FeatureMatch> rigid;
    Rigid3d apparent = FindApparentMotion(candidate, shared, &rigid);
    // Without motion the direction is undetermined.
    if (apparent.translation.norm() < 1e-9) {
      apparent.translation = random.UnitVector();
    }
    const std::vector<Bearing>& bearings1 = bearings_[candidate.first];
    const std::vector<Bearing>& bearings2 = bearings_[candidate.second];
    pair.cam2_from_cam1 =
        RefineTwoViewPose(bearings1, bearings2, rigid, apparent);
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
      const bool is_on_car = landmark < 0;
      if (is_on_car && candidate.IsAlias()) continue;
      const int wanted =
          candidate.IsAlias() ? FindTwin(candidate, landmark) : landmark;
      if (wanted == kNoTwin) continue;
      const auto found = std::lower_bound(index2.begin(), index2.end(),
                                          std::make_pair(wanted, 0));
      if (found == index2.end() || found->first != wanted) continue;
      if (!is_on_car && !LooksSame(map_.landmarks[landmark].position_in_world,
                                   center1, center2)) {
        continue;
      }
      const double rate = candidate.IsAlias() ? kAliasMatchRate : kMatchRate;
      if (random->Uniform(0.0, 1.0) > rate) continue;
      matches.push_back({static_cast<point2D_t>(point1),
                         static_cast<point2D_t>(found->second)});
    }
    return matches;
  }

  // The motion relative to the rigid body, the town or a car, with most of the
  // matches, and the matches on this body.
  Rigid3d FindApparentMotion(const PairCandidate& candidate,
                             const std::vector<FeatureMatch>& matches,
                             std::vector<FeatureMatch>* rigid) const {
    const SyntheticImage& image1 = world_.images[candidate.first];
    const SyntheticImage& image2 = world_.images[candidate.second];
    std::map<int, std::vector<FeatureMatch>> by_body;
    for (const FeatureMatch& match : matches) {
      const int point = image1.car_point_ids.empty()
                            ? -1
                            : image1.car_point_ids[match.point2D_idx1];
      by_body[point < 0 ? -1 : CarOfPoint(point)].push_back(match);
    }
    int body = -1;
    for (const auto& [other, its_matches] : by_body) {
      if (its_matches.size() > by_body[body].size()) body = other;
    }
    *rigid = by_body[body];
    if (body >= 0) {
      return ComputeCam2FromCam1(image1.cam_from_car[body],
                                 image2.cam_from_car[body]);
    }
    return ComputeCam2FromCam1(image1.cam_from_world,
                               candidate.apparent_cam2_from_world);
  }

  static bool LooksSame(const Eigen::Vector3d& position,
                        const Eigen::Vector3d& center1,
                        const Eigen::Vector3d& center2) {
    const double distance1 = (position - center1).norm();
    const double distance2 = (position - center2).norm();
    return distance1 <= kMaxScaleRatio * distance2 &&
           distance2 <= kMaxScaleRatio * distance1 &&
           AngleBetweenRad(position - center1, position - center2) <=
               kMaxViewAngle;
  }

  // The landmark whose place relative to street 2 of the candidate is that of
  // the given one relative to street 1, in a street that looks the same.
  int FindTwin(const PairCandidate& candidate, int landmark) const {
    const Street& street1 = grid_.streets[candidate.street1];
    const Street& street2 = grid_.streets[candidate.street2];
    const int index = map_.StreetOf(landmark);
    const Street& street = grid_.streets[index];
    const auto moved = [&](double u) {
      const Eigen::Vector3d place =
          street.WorldFromLocal(Eigen::Vector3d(u, 0.0, 0.0));
      return street2.WorldFromLocal(street1.LocalFromWorld(place));
    };
    const Eigen::Vector3d begin = moved(0.0);
    const Eigen::Vector3d end = moved(kBlockSize);
    for (int k = street.twin; k >= 0 && k != index; k = grid_.streets[k].twin) {
      const Street& twin = grid_.streets[k];
      const auto place = [&twin](double u) {
        return twin.WorldFromLocal(Eigen::Vector3d(u, 0.0, 0.0));
      };
      if ((place(0.0) - begin).norm() < 1.0 &&
          (place(kBlockSize) - end).norm() < 1.0) {
        return landmark - map_.street_begin[index] + map_.street_begin[k];
      }
    }
    return kNoTwin;
  }

  // Removes right matches where too few keypoints would be free for wrong ones.
  void LeaveRoomForOutliers(const PairCandidate& candidate, Random* random,
                            std::vector<FeatureMatch>* matches) const {
    const size_t num_keypoints = std::min(indices_[candidate.first].size(),
                                          indices_[candidate.second].size());
    const size_t max_num_right = static_cast<size_t>(
        (1.0 - world_.options.outlier_match_ratio) * num_keypoints);
    if (matches->size() <= max_num_right) return;
    random->Shuffle(matches);
    matches->resize(max_num_right);
    std::sort(matches->begin(), matches->end());
  }

  // Joins random keypoints without a match, so that the share of wrong matches
  // is that of the options.
  void AddOutliers(const PairCandidate& candidate, Random* random,
                   std::vector<FeatureMatch>* matches) const {
    const double ratio = world_.options.outlier_match_ratio;
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
    const size_t num = std::min({static_cast<size_t>(std::lround(
                                     ratio / (1.0 - ratio) * matches->size())),
                                 free1.size(), free2.size()});
    for (size_t i = 0; i < num; ++i) matches->push_back({free1[i], free2[i]});
    std::sort(matches->begin(), matches->end());
  }

  const StreetGrid& grid_;
  const LandmarkMap& map_;
  const SyntheticWorld& world_;
  // By image: (landmark, or -1 - point of a car, and keypoint), sorted.
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

// The number of wrong pairs that are a share `ratio` of all pairs, for a number
// of true pairs.
int NumWrongPairs(const SyntheticWorldOptions& options, double ratio,
                  size_t num_true_pairs) {
  const double true_ratio =
      1.0 - options.alias_pair_ratio - options.spurious_pair_ratio;
  return static_cast<int>(std::lround(ratio / true_ratio * num_true_pairs));
}

// Adds aliased pairs until there are num_wanted. Returns how many were found.
int MatchAliases(const Matcher& matcher, const StreetGrid& grid,
                 const SyntheticWorld& world, int num_wanted,
                 std::map<ImagePair, SyntheticPair>* pairs) {
  Random random = MakeRandom(world.options.seed, 11);
  int num_found = 0;
  if (num_wanted == 0) return num_found;
  for (const PairCandidate& candidate : FindAliases(grid, world, &random)) {
    if (num_found >= num_wanted) break;
    std::optional<SyntheticPair> pair = matcher.Match(candidate);
    if (!pair) continue;
    const ImagePair key(pair->image_id1, pair->image_id2);
    if (pairs->emplace(key, std::move(*pair)).second) ++num_found;
  }
  return num_found;
}

}  // namespace

double MatchImages(const StreetGrid& grid, const LandmarkMap& map,
                   const std::vector<double>& arc_lengths_m,
                   SyntheticWorld* world) {
  const SyntheticWorldOptions& options = world->options;
  const Matcher matcher(grid, map, *world);
  std::vector<PairCandidate> candidates = FindSequentialPairs(*world);
  const std::vector<PairCandidate> revisits =
      FindRevisits(*world, arc_lengths_m);
  candidates.insert(candidates.end(), revisits.begin(), revisits.end());
  std::map<ImagePair, SyntheticPair> pairs;
  MatchAll(matcher, AddSecondCamera(*world, std::move(candidates)), &pairs);
  const size_t num_true_pairs = pairs.size();
  const int num_aliases =
      NumWrongPairs(options, options.alias_pair_ratio, num_true_pairs);
  const int num_found =
      MatchAliases(matcher, grid, *world, num_aliases, &pairs);
  AddSpuriousPairs(
      *world,
      NumWrongPairs(options, options.spurious_pair_ratio, num_true_pairs),
      &pairs);
  SpoilRotations(options, &pairs);
  world->pairs.clear();
  for (auto& [key, pair] : pairs) world->pairs.push_back(std::move(pair));
  if (num_found == num_aliases) return options.alias_pair_ratio;
  return (1.0 - options.spurious_pair_ratio) * num_found /
         (num_found + num_true_pairs);
}

}  // namespace adasfm
