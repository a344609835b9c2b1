// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "sensors/smoother/odometry_factors.h"

namespace adasfm {

// The normal equations of one link, H x = -g, over (state k, state k + 1,
// globals).
struct LinkEquations {
  Eigen::Matrix<double, kLinkSize, kLinkSize> h;
  Eigen::Matrix<double, kLinkSize, 1> g;
};

// What one end of the chain knows of (state, globals).
struct ChainMessage {
  static constexpr int kSize = ChainState::kSize + ChainGlobals::kSize;
  Eigen::Matrix<double, kSize, kSize> h =
      Eigen::Matrix<double, kSize, kSize>::Zero();
  Eigen::Matrix<double, kSize, 1> g = Eigen::Matrix<double, kSize, 1>::Zero();
};

struct ChainSolution {
  std::vector<Eigen::Matrix<double, ChainState::kSize, 1>> states;
  ChainGlobals::Vector globals;
};

// The equations of link k; called once per pass and link, in order.
using LinkEquationsFunction = std::function<LinkEquations(size_t)>;

// Solves the chain of num_links + 1 states: eliminates states from the front,
// then substitutes back. first holds the priors of state 0 and the globals.
// damping is added to each state's diagonal, in proportion to it.
ChainSolution SolveChain(size_t num_links, const ChainMessage& first,
                         const LinkEquationsFunction& equations,
                         double damping);

// The marginal covariance of each link's coordinates given all others. The
// heading of state k is held fixed, as nothing observes it: the rest is
// relative to it.
using LinkCovariance = Eigen::Matrix<double, kLinkSize, kLinkSize>;
void ComputeChainCovariances(
    size_t num_links, const ChainMessage& first,
    const LinkEquationsFunction& equations,
    const std::function<void(size_t, const LinkCovariance&)>& receive);

}  // namespace adasfm
