// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/mapper_start.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

// Defaults of COLMAP's Mapper.init_min_num_inliers, init_min_tri_angle and
// init_max_forward_motion.
constexpr int kMinNumMatches = 100;
constexpr double kMinParallaxRad = DegToRad(16.0);
constexpr double kMaxForwardMotion = 0.95;

}  // namespace

std::optional<MapperStart> FindMapperStart(
    const std::vector<RefinedPair>& pairs) {
  std::optional<MapperStart> start;
  double most = 0.0;
  bool mapper_finds_one = false;
  for (const RefinedPair& pair : pairs) {
    const int num_matches = static_cast<int>(pair.matches.size());
    if (pair.removed || num_matches < kMinNumMatches) continue;
    const double angle = std::min(pair.median_parallax_rad, kMinParallaxRad);
    mapper_finds_one |=
        angle == kMinParallaxRad &&
        std::abs(pair.cam2_from_cam1.translation.z()) <
            kMaxForwardMotion * pair.cam2_from_cam1.translation.norm();
    const double information = num_matches * angle * angle;
    if (information <= most) continue;
    most = information;
    start = {pair.pair, num_matches, pair.median_parallax_rad};
  }
  if (start) start->must_be_told = !mapper_finds_one;
  return start;
}

}  // namespace adasfm
