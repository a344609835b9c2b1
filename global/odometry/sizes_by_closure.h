// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

namespace adasfm {

// Images of the view graph that are rigid but for their size.
struct SizedSet {
  std::vector<int> images;
  // By how much the set's shape errs, as a share of its extent.
  double shape_sigma = 0.0;
};

// What: the sets whose sizes closed rings of sets tell. A bar between two
// others has a direction but no length: three bars in a triangle have one size,
// four in a plane have not.
// Inputs: the sets; by image, its centre in any one frame in which every set is
// right but for its size and place (empty for images without one).
// Method. Sets that share an image agree on its place: x = t_k + s_k (c - m_k)
// with an error of shape_sigma |c - m_k| on either side, m_k the mean of the
// set's shared images. Linear in the sizes s_k and places t_k; two sizes are
// one where the least-squares covariance tells their ratio to 5 % (1 sigma).
// Returns the pairs of sets of one size, enough to join them all. On failure:
// without a ring nothing is joined.
std::vector<std::pair<int, int>> FindSizesByClosure(
    const std::vector<SizedSet>& sets,
    const std::vector<std::optional<Eigen::Vector3d>>& centers);

}  // namespace adasfm
