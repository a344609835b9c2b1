// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/pairs_among.h"

#include <algorithm>

namespace adasfm {

std::vector<const ScenePair*> FindPairsAmong(const SceneData& scene,
                                             const std::set<image_t>& images) {
  std::vector<const ScenePair*> pairs;
  auto pair = scene.pairs.begin();
  for (const image_t image_id : images) {
    pair = std::lower_bound(pair, scene.pairs.end(), image_id,
                            [](const ScenePair& candidate, image_t image_id1) {
                              return candidate.image_id1 < image_id1;
                            });
    for (; pair != scene.pairs.end() && pair->image_id1 == image_id; ++pair) {
      if (images.count(pair->image_id2)) pairs.push_back(&*pair);
    }
  }
  return pairs;
}

}  // namespace adasfm
