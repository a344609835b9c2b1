// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/false_pairs.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/so3.h"
#include "synthetic/street_grid.h"
#include "synthetic/two_view_refinement.h"

namespace adasfm {
namespace {

constexpr int kMinNumMatches = 15;
constexpr int kMaxNumMatches = 25;
// Raw matches per match that fits.
constexpr int kNumRawPerMatch = 4;
constexpr double kMaxSpuriousTurn = DegToRad(40.0);
constexpr double kMinOutlierTurn = DegToRad(15.0);
constexpr double kMaxOutlierTurn = DegToRad(90.0);

Eigen::Quaterniond DrawRotation(double min_rad, double max_rad,
                                Random* random) {
  const double angle = random->Uniform(min_rad, max_rad);
  return ExpSo3(angle * random->UnitVector());
}

// Nothing when too few keypoints fit the pose.
std::optional<SyntheticPair> MakeSpuriousPair(const SyntheticWorld& world,
                                              const SyntheticImage& image1,
                                              const SyntheticImage& image2,
                                              Random* random) {
  SyntheticPair pair;
  pair.image_id1 = image1.image_id;
  pair.image_id2 = image2.image_id;
  pair.is_spurious = true;
  pair.cam2_from_cam1 = Rigid3d(DrawRotation(0.0, kMaxSpuriousTurn, random),
                                random->UnitVector());
  const std::vector<Bearing> bearings1 = ComputeBearings(world.camera, image1);
  const std::vector<Bearing> bearings2 = ComputeBearings(world.camera, image2);
  std::vector<int> order1 = random->Sample(bearings1.size(), bearings1.size());
  std::vector<int> order2 = random->Sample(bearings2.size(), bearings2.size());
  const size_t num_wanted = random->UniformInt(kMinNumMatches, kMaxNumMatches);
  std::vector<bool> is_used2(order2.size(), false);
  for (const int k1 : order1) {
    const bool is_done = pair.inlier_matches.size() >= num_wanted;
    if (is_done && pair.raw_matches.size() >= kNumRawPerMatch * num_wanted) {
      break;
    }
    for (const int k2 : order2) {
      const bool fits =
          ComputeSampsonErrorPx(bearings1[k1], bearings2[k2],
                                pair.cam2_from_cam1) <= kMaxEpipolarErrorPx;
      if (is_used2[k2] || fits == is_done) continue;
      const FeatureMatch match = {static_cast<point2D_t>(k1),
                                  static_cast<point2D_t>(k2)};
      pair.raw_matches.push_back(match);
      if (fits) pair.inlier_matches.push_back(match);
      is_used2[k2] = true;
      break;
    }
  }
  if (pair.inlier_matches.size() < num_wanted) return {};
  std::sort(pair.raw_matches.begin(), pair.raw_matches.end());
  std::sort(pair.inlier_matches.begin(), pair.inlier_matches.end());
  return pair;
}

}  // namespace

void AddSpuriousPairs(const SyntheticWorld& world, int num_pairs,
                      std::map<ImagePair, SyntheticPair>* pairs) {
  Random random = MakeRandom(world.options.seed, 15);
  const int64_t num_images = world.images.size();
  const size_t num_before = pairs->size();
  // Most draws succeed unless nearly all images are joined.
  const int64_t max_num_draws = 20 * int64_t{num_pairs} + 1000;
  int num_left = num_pairs;
  for (int64_t draw = 0; draw < max_num_draws && num_left > 0; ++draw) {
    const int64_t i = random.UniformInt(0, num_images - 1);
    const int64_t j = random.UniformInt(0, num_images - 1);
    if (i >= j) continue;
    const SyntheticImage& image1 = world.images[i];
    const SyntheticImage& image2 = world.images[j];
    const ImagePair key(image1.image_id, image2.image_id);
    if (pairs->count(key) > 0) continue;
    std::optional<SyntheticPair> pair =
        MakeSpuriousPair(world, image1, image2, &random);
    if (!pair) continue;
    pairs->emplace(key, std::move(*pair));
    --num_left;
  }
  if (num_left == 0) return;
  throw std::invalid_argument(
      "SyntheticWorldOptions: spurious_pair_ratio = " +
      std::to_string(world.options.spurious_pair_ratio) +
      " needs more images; the largest possible value is about " +
      std::to_string(static_cast<double>(num_pairs - num_left) /
                     (num_before + num_pairs - num_left)));
}

void SpoilRotations(const SyntheticWorldOptions& options,
                    std::map<ImagePair, SyntheticPair>* pairs) {
  Random random = MakeRandom(options.seed, 16);
  std::vector<SyntheticPair*> true_pairs;
  for (auto& [key, pair] : *pairs) {
    if (!pair.is_alias && !pair.is_spurious) true_pairs.push_back(&pair);
  }
  const int num_pairs = static_cast<int>(true_pairs.size());
  const int num_spoilt =
      std::lround(options.rotation_outlier_ratio * num_pairs);
  for (const int k : random.Sample(num_spoilt, num_pairs)) {
    SyntheticPair& pair = *true_pairs[k];
    pair.cam2_from_cam1.rotation =
        DrawRotation(kMinOutlierTurn, kMaxOutlierTurn, &random) *
        pair.cam2_from_cam1.rotation;
    pair.is_rotation_outlier = true;
  }
}

}  // namespace adasfm
