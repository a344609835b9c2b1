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

// Normal equations of one end of the chain, reduced to (state, globals).
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

// The equations of link k; called once per pass and link, in the pass's order.
using LinkEquationsFunction = std::function<LinkEquations(size_t)>;

// Solves the chain of num_links + 1 states: eliminates states from the front,
// then substitutes back. `first` contains the priors of state 0 and the
// globals. Each state's diagonal is multiplied by 1 + damping.
ChainSolution SolveChain(size_t num_links, const ChainMessage& first,
                         const LinkEquationsFunction& equations,
                         double damping);

// The marginal covariance of each link's coordinates in the whole chain. The
// heading of state k is fixed, since no residual observes it; the covariance is
// relative to it.
using LinkCovariance = Eigen::Matrix<double, kLinkSize, kLinkSize>;
void ComputeChainCovariances(
    size_t num_links, const ChainMessage& first,
    const LinkEquationsFunction& equations,
    const std::function<void(size_t, const LinkCovariance&)>& receive);

}  // namespace adasfm
