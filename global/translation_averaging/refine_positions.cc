// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/refine_positions.h"

#include <algorithm>
#include <cmath>

#include "core/median.h"
#include "core/sparse/block_matrix.h"
#include "core/sparse/ordered_cholesky.h"

namespace adasfm {
namespace {

using Vectors = LaplacianSolver::Vectors;

// The information matrix of C_j - C_i and its target.
struct EdgeTerm {
  Eigen::Matrix3d information;
  Eigen::Vector3d target;
};

EdgeTerm ComputeTerm(const PositionEdge& edge,
                     const Eigen::Vector3d& difference, double min_length) {
  // An edge without a length keeps the present one, with this relative sigma,
  // which damps the step and fixes the scale.
  constexpr double kFreeLengthSigma = 1.0;
  // Where the Cauchy loss takes over, in sigmas.
  constexpr double kLossScale = 2.0;
  const double along = edge.direction.dot(difference);
  const bool is_free = edge.kind == PositionEdge::kFree || edge.is_redundant;
  const double length =
      std::max(min_length, is_free ? std::abs(along) : edge.length);
  const double across_sigma = length * edge.direction_sigma;
  double along_sigma = is_free ? length * kFreeLengthSigma : edge.length_sigma;
  along_sigma = std::max(along_sigma, kMinPositionSigmaRatio * length);
  const Eigen::Matrix3d projection =
      edge.direction * edge.direction.transpose();
  EdgeTerm term;
  term.target = (is_free ? length : edge.length) * edge.direction;
  term.information = (Eigen::Matrix3d::Identity() - projection) /
                         (across_sigma * across_sigma) +
                     projection / (along_sigma * along_sigma);
  const Eigen::Vector3d residual = difference - term.target;
  const double squared = residual.dot(term.information * residual);
  term.information /= 1.0 + squared / std::pow(kLossScale, 2);
  return term;
}

// The normal equations of all centres but the first.
class RefinementSystem {
 public:
  RefinementSystem(const std::vector<PositionEdge>& edges, int num_nodes) {
    for (int i = 1; i < num_nodes; ++i) matrix_.AddBlock(3);
    for (const PositionEdge& edge : edges) {
      if (edge.i > 0 && edge.j > 0) matrix_.AddPair(edge.i - 1, edge.j - 1);
    }
    block_of_ = matrix_.Reorder();
    matrix_.Allocate();
    factorization_.analyzePattern(matrix_.Matrix());
  }

  void Clear() {
    matrix_.Matrix().coeffs().setZero();
    right_side_.setZero(matrix_.NumColumns());
  }

  void Add(const PositionEdge& edge, const EdgeTerm& term) {
    const Eigen::Vector3d flow = term.information * term.target;
    if (edge.i > 0) AddNode(edge.i, term.information, -flow);
    if (edge.j > 0) AddNode(edge.j, term.information, flow);
    if (edge.i > 0 && edge.j > 0) {
      const auto [col, row] =
          std::minmax(block_of_[edge.i - 1], block_of_[edge.j - 1]);
      matrix_.Add(row, col, -term.information);
    }
  }

  // Sets all centres; false where the equations are singular.
  bool Solve(Vectors* centers) {
    factorization_.factorize(matrix_.Matrix());
    if (factorization_.info() != Eigen::Success) return false;
    const Eigen::VectorXd solution = factorization_.solve(right_side_);
    if (!solution.allFinite()) return false;
    centers->resize(block_of_.size() + 1, 3);
    centers->row(0).setZero();
    for (size_t k = 0; k < block_of_.size(); ++k) {
      centers->row(k + 1) = solution.segment<3>(3 * block_of_[k]).transpose();
    }
    return true;
  }

 private:
  void AddNode(int node, const Eigen::Matrix3d& information,
               const Eigen::Vector3d& flow) {
    const int block = block_of_[node - 1];
    matrix_.Add(block, block, information);
    right_side_.segment<3>(3 * block) += flow;
  }

  BlockMatrix matrix_;
  std::vector<int> block_of_;  // Of node k + 1.
  Eigen::VectorXd right_side_;
  OrderedCholesky factorization_;
};

}  // namespace

bool RefinePositions(const std::vector<PositionEdge>& edges, Vectors* centers,
                     GlobalPositions* result) {
  const int num_nodes = centers->rows();
  if (num_nodes < 2) return true;
  std::vector<double> lengths;
  for (const PositionEdge& edge : edges) {
    lengths.push_back((centers->row(edge.j) - centers->row(edge.i)).norm());
  }
  const double unit = UpperMedian(&lengths);
  if (!(unit > 0.0)) return false;

  constexpr int kMaxNumIterations = 100;
  RefinementSystem system(edges, num_nodes);
  for (int k = 0; k < kMaxNumIterations; ++k) {
    system.Clear();
    for (const PositionEdge& edge : edges) {
      const Eigen::Vector3d difference =
          (centers->row(edge.j) - centers->row(edge.i)).transpose();
      system.Add(edge, ComputeTerm(edge, difference, 0.02 * unit));
    }
    Vectors next;
    if (!system.Solve(&next)) return false;
    const Eigen::RowVector3d origin = centers->row(0);
    result->last_change =
        (next - (centers->rowwise() - origin)).rowwise().norm().mean() / unit;
    *centers = next;
    ++result->num_iterations;
    if (result->last_change < kPositionConvergenceRatio) return true;
  }
  return false;
}

}  // namespace adasfm
