// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <unordered_map>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/types.h"

namespace adasfm {

// Which of some images share points.
class Covisibility {
 public:
  // Images that share fewer points than this count as sharing none.
  Covisibility(const std::set<image_t>& images,
               const colmap::Reconstruction& reconstruction,
               int min_num_shared_points = 1);
  // Raises that number.
  void Cut(int min_num_shared_points);

  // Of each image, in order of ids, the places of those behind it that share
  // points with it; sorted.
  const std::vector<std::vector<int>>& Neighbors() const { return neighbors_; }

  // The images of a point's track in groups in which any two share points: of
  // each image the group. An image goes into the first group that it fits, and
  // one that is not among the images of the constructor fits all.
  std::vector<int> CutTrack(const std::vector<image_t>& images) const;

 private:
  // -1: not among the images.
  int IndexOf(image_t image_id) const;
  bool SharePoints(int index1, int index2) const;

  std::unordered_map<image_t, int> index_of_;
  std::vector<std::vector<int>> neighbors_;
  // Points, by neighbor.
  std::vector<std::vector<int>> num_shared_;
};

}  // namespace adasfm
