// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

namespace adasfm {

// Images of the view graph that are rigid up to scale.
struct SizedSet {
  std::vector<int> images;
  // 1 sigma of the set's shape, as a share of its extent.
  double shape_sigma = 0.0;
};

// Finds the sets whose relative scale is determined by closed rings of sets. A
// bar between two others has a direction but no length: three bars in a
// triangle have one scale, four in a plane have not. centers: by image, in any
// one frame in which every set is right up to scale and place (empty for images
// without a centre).
//
// Sets that share an image agree on its place: x = t_k + s_k (c - m_k) with an
// error of shape_sigma |c - m_k| on either side, m_k the mean of the set's
// shared images. This is linear in the scales s_k and places t_k. Two sets have
// one scale where the least-squares covariance determines the ratio to 5 % (1
// sigma). Returns the pairs of sets of one scale, enough to join them all; none
// without a ring.
std::vector<std::pair<int, int>> FindSizesByClosure(
    const std::vector<SizedSet>& sets,
    const std::vector<std::optional<Eigen::Vector3d>>& centers);

}  // namespace adasfm
