// SPDX-License-Identifier: BSD-3-Clause
#include "global/calibration/correct_rotation_rates.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/so3.h"

namespace adasfm {
namespace {

// Spans of the drive; spans of one piece of the chain follow each other.
struct Windows {
  // By position in the chain: the span of the step that ends there, -1 where
  // none does, and the step's duration.
  std::vector<int> window_of_step;
  std::vector<double> seconds_of_step;
  // By span: whether it continues the span before.
  std::vector<bool> continues;
};

Windows BuildWindows(const RotationRateOptions& options,
                     const OdometryChain& chain,
                     const std::vector<RelativePosePrior>& priors) {
  Windows windows;
  struct Step {
    int piece;
    double seconds;
  };
  std::map<int, Step> steps;
  for (const RelativePosePrior& prior : priors) {
    if (!chain.IsConnected(prior.image_id1, prior.image_id2)) continue;
    if (chain.NumSteps(prior.image_id1, prior.image_id2) != 1) continue;
    steps[chain.Index(prior.image_id2)] = {chain.Piece(prior.image_id2),
                                           SecondsFromNs(prior.dt_ns)};
  }
  if (steps.empty()) return windows;
  windows.window_of_step.assign(steps.rbegin()->first + 1, -1);
  windows.seconds_of_step.assign(steps.rbegin()->first + 1, 0.0);
  int piece = -1;
  double elapsed_s = 0.0;
  for (const auto& [index, step] : steps) {
    if (step.piece != piece || elapsed_s > options.window_s) {
      windows.continues.push_back(step.piece == piece);
      elapsed_s = 0.0;
    }
    piece = step.piece;
    elapsed_s += step.seconds;
    windows.window_of_step[index] = windows.continues.size() - 1;
    windows.seconds_of_step[index] = step.seconds;
  }
  return windows;
}

// What one pair says of its span: error = jacobian * rate.
struct RatePair {
  int window = 0;
  Eigen::Vector3d error;
  Eigen::Matrix3d jacobian;
  // 1 sigma of the error's axes.
  double sigma = 0.0;
  // Pairs of many steps overlap with as many others.
  int num_steps = 1;
};

std::vector<RatePair> CollectPairs(const RotationRateOptions& options,
                                   const OdometryChain& chain,
                                   const Windows& windows,
                                   const ViewGraph& graph) {
  std::vector<RatePair> pairs;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || !edge.has_rotation ||
        edge.source == EdgeSource::kSensor ||
        !chain.IsConnected(edge.image_id1, edge.image_id2)) {
      continue;
    }
    image_t first = edge.image_id1;
    image_t last = edge.image_id2;
    Eigen::Quaterniond last_from_first = edge.cam2_from_cam1.rotation;
    if (chain.NumSteps(first, last) < 0) {
      std::swap(first, last);
      last_from_first = last_from_first.conjugate();
    }
    RatePair pair;
    pair.num_steps = chain.NumSteps(first, last);
    if (pair.num_steps > options.max_num_steps) continue;
    const ChainMotion motion = chain.Motion(first, last);
    if (!motion.has_rotation) continue;
    const int begin = chain.Index(first);
    pair.window = windows.window_of_step.at(begin + (pair.num_steps + 1) / 2);
    double seconds = 0.0;
    for (int k = 1; k <= pair.num_steps; ++k) {
      seconds += windows.seconds_of_step.at(begin + k);
    }
    // The mean turn of the frames in between is good enough for a few steps.
    const Eigen::Quaterniond half =
        ExpSo3(0.5 * LogSo3(motion.cam2_from_cam1.rotation));
    pair.jacobian = seconds * half.toRotationMatrix();
    pair.error =
        LogSo3(last_from_first * motion.cam2_from_cam1.rotation.conjugate());
    pair.sigma =
        std::max(options.min_rotation_sigma_rad, edge.rotation_sigma_rad);
    if (pair.window >= 0) pairs.push_back(pair);
  }
  return pairs;
}

using Rates = std::vector<Eigen::Vector3d>;  // by span

std::vector<double> ComputeWeights(const std::vector<RatePair>& pairs,
                                   const Rates& rates) {
  constexpr double kHuberSigmas = 1.5;
  std::vector<double> weights;
  weights.reserve(pairs.size());
  for (const RatePair& pair : pairs) {
    const double sigmas =
        (pair.error - pair.jacobian * rates[pair.window]).norm() / pair.sigma;
    weights.push_back(std::min(1.0, kHuberSigmas / std::max(sigmas, 1e-9)) /
                      (pair.sigma * pair.sigma * pair.num_steps));
  }
  return weights;
}

// One weighted least-squares solution: a chain of 3 x 3 blocks, eliminated from
// its start.
Rates SolveRates(const RotationRateOptions& options, const Windows& windows,
                 const std::vector<RatePair>& pairs, const Rates& last) {
  const std::vector<double> weights = ComputeWeights(pairs, last);
  const size_t count = windows.continues.size();
  const double coupling = std::pow(options.drift_sigma_rad_s, -2);
  std::vector<Eigen::Matrix3d> blocks(
      count,
      std::pow(options.rate_sigma_rad_s, -2) * Eigen::Matrix3d::Identity());
  Rates rates(count, Eigen::Vector3d::Zero());
  for (size_t k = 0; k < pairs.size(); ++k) {
    const RatePair& pair = pairs[k];
    const Eigen::Matrix3d weighted = weights[k] * pair.jacobian.transpose();
    blocks[pair.window] += weighted * pair.jacobian;
    rates[pair.window] += weighted * pair.error;
  }
  for (size_t w = 0; w < count; ++w) {
    if (!windows.continues[w]) continue;
    blocks[w - 1] += coupling * Eigen::Matrix3d::Identity();
    blocks[w] += coupling * Eigen::Matrix3d::Identity();
  }
  for (size_t w = 1; w < count; ++w) {
    if (!windows.continues[w]) continue;
    const Eigen::LLT<Eigen::Matrix3d> previous(blocks[w - 1]);
    blocks[w] -=
        coupling * coupling * previous.solve(Eigen::Matrix3d::Identity());
    rates[w] += coupling * previous.solve(rates[w - 1]);
  }
  for (size_t w = count; w-- > 0;) {
    if (w + 1 < count && windows.continues[w + 1]) {
      rates[w] += coupling * rates[w + 1];
    }
    rates[w] = blocks[w].llt().solve(rates[w]).eval();
  }
  return rates;
}

}  // namespace

bool RotationRateOptions::IsValid(std::string* error) const {
  if (max_num_steps < 1) {
    *error =
        "max_num_steps = " + std::to_string(max_num_steps) + " must be >= 1";
    return false;
  }
  if (!(window_s > 0.0) || !(rate_sigma_rad_s > 0.0) ||
      !(drift_sigma_rad_s > 0.0) || !(min_rotation_sigma_rad > 0.0)) {
    *error =
        "window_s, rate_sigma_rad_s, drift_sigma_rad_s and "
        "min_rotation_sigma_rad must be > 0";
    return false;
  }
  return true;
}

RotationRateReport CorrectRotationRates(
    const RotationRateOptions& options, const OdometryChain& chain,
    const ViewGraph& graph, std::vector<RelativePosePrior>* priors) {
  constexpr int kNumIterations = 8;
  RotationRateReport report;
  const Windows windows = BuildWindows(options, chain, *priors);
  const std::vector<RatePair> pairs =
      CollectPairs(options, chain, windows, graph);
  report.num_pairs = pairs.size();
  if (pairs.empty()) return report;
  Rates rates(windows.continues.size(), Eigen::Vector3d::Zero());
  for (int k = 0; k < kNumIterations; ++k) {
    rates = SolveRates(options, windows, pairs, rates);
  }
  for (const Eigen::Vector3d& rate : rates) {
    if (!rate.allFinite()) return RotationRateReport();
    report.max_rate_rad_s = std::max(report.max_rate_rad_s, rate.norm());
  }
  for (RelativePosePrior& prior : *priors) {
    if (!prior.HasRotation() ||
        !chain.IsConnected(prior.image_id1, prior.image_id2) ||
        chain.NumSteps(prior.image_id1, prior.image_id2) != 1) {
      continue;
    }
    const int window = windows.window_of_step[chain.Index(prior.image_id2)];
    report.corrected = true;
    prior.cam2_from_cam1.rotation =
        (ExpSo3(SecondsFromNs(prior.dt_ns) * rates[window]) *
         prior.cam2_from_cam1.rotation)
            .normalized();
  }
  return report;
}

}  // namespace adasfm
