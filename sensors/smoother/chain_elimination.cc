// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/smoother/chain_elimination.h"

#include <Eigen/Cholesky>

namespace adasfm {
namespace {

constexpr int kState = ChainState::kSize;
constexpr int kRest = ChainMessage::kSize;  // the next state and the globals

using StateMatrix = Eigen::Matrix<double, kState, kState>;
using Gain = Eigen::Matrix<double, kState, kRest>;

// x_k = offset - gain (x_k+1, globals).
struct Substitution {
  Gain gain;
  Eigen::Matrix<double, kState, 1> offset;
};

// Adds the message about (state k, globals) to a link's equations.
void AddToFirst(const ChainMessage& message, LinkEquations* link) {
  constexpr int kGlobals = ChainGlobals::kSize;
  link->h.topLeftCorner<kState, kState>() +=
      message.h.topLeftCorner<kState, kState>();
  link->h.topRightCorner<kState, kGlobals>() +=
      message.h.topRightCorner<kState, kGlobals>();
  link->h.bottomLeftCorner<kGlobals, kState>() +=
      message.h.bottomLeftCorner<kGlobals, kState>();
  link->h.bottomRightCorner<kGlobals, kGlobals>() +=
      message.h.bottomRightCorner<kGlobals, kGlobals>();
  link->g.head<kState>() += message.g.head<kState>();
  link->g.tail<kGlobals>() += message.g.tail<kGlobals>();
}

void AddToSecond(const ChainMessage& message, LinkEquations* link) {
  link->h.bottomRightCorner<kRest, kRest>() += message.h;
  link->g.tail<kRest>() += message.g;
}

// Removes state k from the equations: the Schur complement on the rest.
ChainMessage EliminateFirst(const LinkEquations& link, double damping,
                            Substitution* substitution) {
  StateMatrix block = link.h.topLeftCorner<kState, kState>();
  block.diagonal() *= 1.0 + damping;
  const Eigen::LLT<StateMatrix> llt(block);
  const Gain coupling = link.h.topRightCorner<kState, kRest>();
  const Gain gain = llt.solve(coupling);
  const Eigen::Matrix<double, kState, 1> offset =
      llt.solve(link.g.head<kState>());
  ChainMessage message;
  message.h.noalias() =
      link.h.bottomRightCorner<kRest, kRest>() - coupling.transpose() * gain;
  message.h = (0.5 * (message.h + message.h.transpose())).eval();
  message.g = link.g.tail<kRest>() - coupling.transpose() * offset;
  if (substitution != nullptr) {
    substitution->gain = gain;
    substitution->offset = -offset;
  }
  return message;
}

// Removes state k + 1: the message of link k and all later ones about (state k,
// globals).
ChainMessage EliminateSecond(const LinkEquations& link) {
  LinkEquations swapped;
  Eigen::Matrix<int, kLinkSize, 1> order;
  for (int i = 0; i < kLinkSize; ++i) {
    order[i] = i < kState ? kState + i : (i < 2 * kState ? i - kState : i);
  }
  for (int i = 0; i < kLinkSize; ++i) {
    swapped.g[i] = link.g[order[i]];
    for (int j = 0; j < kLinkSize; ++j) {
      swapped.h(i, j) = link.h(order[i], order[j]);
    }
  }
  return EliminateFirst(swapped, 0.0, nullptr);
}

}  // namespace

ChainSolution SolveChain(size_t num_links, const ChainMessage& first,
                         const LinkEquationsFunction& equations,
                         double damping) {
  std::vector<Substitution> substitutions(num_links);
  ChainMessage message = first;
  for (size_t k = 0; k < num_links; ++k) {
    LinkEquations link = equations(k);
    AddToFirst(message, &link);
    message = EliminateFirst(link, damping, &substitutions[k]);
  }
  ChainSolution solution;
  solution.states.resize(num_links + 1);
  message.h.diagonal().head<kState>() *= 1.0 + damping;
  Eigen::Matrix<double, kRest, 1> rest = -message.h.llt().solve(message.g);
  solution.globals = rest.tail<ChainGlobals::kSize>();
  solution.states[num_links] = rest.head<kState>();
  for (size_t k = num_links; k-- > 0;) {
    const Substitution& back = substitutions[k];
    solution.states[k] = back.offset - back.gain * rest;
    rest.head<kState>() = solution.states[k];
  }
  return solution;
}

void ComputeChainCovariances(
    size_t num_links, const ChainMessage& first,
    const LinkEquationsFunction& equations,
    const std::function<void(size_t, const LinkCovariance&)>& receive) {
  std::vector<ChainMessage> forward(num_links + 1);
  forward[0] = first;
  for (size_t k = 0; k < num_links; ++k) {
    LinkEquations link = equations(k);
    AddToFirst(forward[k], &link);
    forward[k + 1] = EliminateFirst(link, 0.0, nullptr);
  }
  constexpr int kHeading = ChainState::kRotation + 2;
  ChainMessage backward;
  for (size_t k = num_links; k-- > 0;) {
    LinkEquations link = equations(k);
    AddToSecond(backward, &link);
    LinkEquations all = link;
    AddToFirst(forward[k], &all);
    all.h.row(kHeading).setZero();
    all.h.col(kHeading).setZero();
    all.h(kHeading, kHeading) = 1.0;
    LinkCovariance covariance = all.h.llt().solve(LinkCovariance::Identity());
    covariance(kHeading, kHeading) = 0.0;
    receive(k, 0.5 * (covariance + covariance.transpose()));
    // The last state has no backward message; its block is regular only because
    // a link constrains its own second state.
    backward = EliminateSecond(link);
  }
}

}  // namespace adasfm
