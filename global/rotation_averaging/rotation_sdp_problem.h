// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <limits>
#include <vector>

#include "global/rotation_averaging/rotation_sdp.h"

namespace adasfm {

// Y_i of the relaxation: 3 x rank.
constexpr int kMaxRotationRank = 12;
using RotationBlock =
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxRotationRank>;

// Both directions of every edge, by node, with weights of at most one.
class RotationSdpProblem {
 public:
  struct Neighbour {
    int node = 0;
    Eigen::Matrix3d weighted_rotation;  // node -> this one
  };

  RotationSdpProblem(const std::vector<RotationEdge>& edges, size_t num_nodes)
      : neighbours_(num_nodes) {
    double smallest_variance = std::numeric_limits<double>::infinity();
    for (const RotationEdge& edge : edges) {
      smallest_variance =
          std::min(smallest_variance, edge.sigma_rad * edge.sigma_rad);
    }
    for (const RotationEdge& edge : edges) {
      const double weight =
          smallest_variance / (edge.sigma_rad * edge.sigma_rad);
      neighbours_[edge.j].push_back({edge.i, weight * edge.rotation});
      neighbours_[edge.i].push_back(
          {edge.j, weight * edge.rotation.transpose()});
      sum_weights_ += weight;
    }
  }

  size_t size() const { return neighbours_.size(); }

  RotationBlock Sum(const std::vector<RotationBlock>& blocks, size_t i) const {
    RotationBlock sum = RotationBlock::Zero(3, blocks[i].cols());
    for (const Neighbour& neighbour : neighbours_[i]) {
      sum.noalias() += neighbour.weighted_rotation * blocks[neighbour.node];
    }
    return sum;
  }

  // sum of w |R_j - R_ij R_i|^2.
  double Cost(const std::vector<RotationBlock>& blocks) const {
    double gain = 0.0;
    for (size_t i = 0; i < size(); ++i) {
      gain += Sum(blocks, i).cwiseProduct(blocks[i]).sum();
    }
    return 6.0 * sum_weights_ - gain;
  }

  const std::vector<Neighbour>& Neighbours(size_t i) const {
    return neighbours_[i];
  }

  // The multipliers of Y_i Y_i^T = I: the symmetric part of Sum_i Y_i^T.
  Eigen::Matrix3d Multiplier(const std::vector<RotationBlock>& blocks,
                             size_t i) const {
    const Eigen::Matrix3d product = Sum(blocks, i) * blocks[i].transpose();
    return 0.5 * (product + product.transpose());
  }

 private:
  std::vector<std::vector<Neighbour>> neighbours_;
  double sum_weights_ = 0.0;
};

}  // namespace adasfm
