// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/types.h"

namespace adasfm {

// Determines which of a set of images share points.
class Covisibility {
 public:
  // Images that share fewer points than this count as sharing none.
  Covisibility(const std::set<image_t>& images,
               const colmap::Reconstruction& reconstruction,
               int min_num_shared_points = 1);
  // Raises min_num_shared_points.
  void Cut(int min_num_shared_points);
  // Images that share fewer points than this count as sharing none, too, where
  // a third image shares so many with both and thus connects them.
  void CutRedundant(int min_num_shared_points);

  // For each image, in order of ids: the sorted indices of the later images
  // that share points with it.
  const std::vector<std::vector<int>>& Neighbors() const { return neighbors_; }

  // Splits a point's track into groups in which any two images share points.
  // Returns the group of each image. An image joins the first group that it
  // fits; an image that is not among those of the constructor fits all groups.
  std::vector<int> CutTrack(const std::vector<image_t>& images) const;

 private:
  // -1: not among the images of the constructor.
  int IndexOf(image_t image_id) const;
  bool SharePoints(int index1, int index2) const;
  // Keeps the pairs for which keep(index1, index2, num_shared) is true, and
  // marks those near each other.
  template <typename Function>
  void Filter(const Function& keep);

  std::vector<image_t> images_;  // Sorted.
  std::vector<std::vector<int>> neighbors_;
  // Numbers of shared points, parallel to neighbors_.
  std::vector<std::vector<int>> num_shared_;
  // Bit k of an image: the image k + 1 places later shares points with it. No
  // search is needed for most images of a track.
  std::vector<uint64_t> near_;
};

}  // namespace adasfm
