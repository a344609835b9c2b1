// SPDX-License-Identifier: BSD-3-Clause
#include "global/translation_averaging/refine_positions.h"

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

#include "core/median.h"

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

// Supernodal: for 30,000 images the factor has tens of millions of entries.
// Prints nothing: the caller reports failures.
class QuietCholesky
    : public Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> {
 public:
  QuietCholesky() { cholmod().print = 0; }
};

class RefinementSystem {
 public:
  explicit RefinementSystem(int num_nodes) : size_(3 * (num_nodes - 1)) {}

  void Clear(size_t num_edges) {
    triplets_.clear();
    triplets_.reserve(27 * num_edges + size_);
    right_side_ = Eigen::VectorXd::Zero(size_);
  }

  void Add(const PositionEdge& edge, const EdgeTerm& term) {
    const int i = edge.i - 1;
    const int j = edge.j - 1;
    const Eigen::Vector3d flow = term.information * term.target;
    if (i >= 0) {
      AddBlock(i, i, term.information);
      right_side_.segment<3>(3 * i) -= flow;
    }
    if (j >= 0) {
      AddBlock(j, j, term.information);
      right_side_.segment<3>(3 * j) += flow;
    }
    if (i >= 0 && j >= 0) {
      AddBlock(std::max(i, j), std::min(i, j), -term.information);
    }
  }

  bool Solve(Eigen::VectorXd* solution) {
    Eigen::SparseMatrix<double> matrix(size_, size_);
    matrix.setFromTriplets(triplets_.begin(), triplets_.end());
    if (!is_analyzed_) {
      factorization_.analyzePattern(matrix);
      is_analyzed_ = true;
    }
    factorization_.factorize(matrix);
    if (factorization_.info() != Eigen::Success) return false;
    *solution = factorization_.solve(right_side_);
    return solution->allFinite();
  }

 private:
  void AddBlock(int row, int col, const Eigen::Matrix3d& block) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        // The lower triangle only.
        if (row == col && c > r) continue;
        triplets_.emplace_back(3 * row + r, 3 * col + c, block(r, c));
      }
    }
  }

  int size_;
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::VectorXd right_side_;
  QuietCholesky factorization_;
  bool is_analyzed_ = false;
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
  RefinementSystem system(num_nodes);
  for (int k = 0; k < kMaxNumIterations; ++k) {
    system.Clear(edges.size());
    for (const PositionEdge& edge : edges) {
      const Eigen::Vector3d difference =
          (centers->row(edge.j) - centers->row(edge.i)).transpose();
      system.Add(edge, ComputeTerm(edge, difference, 0.02 * unit));
    }
    Eigen::VectorXd solution;
    if (!system.Solve(&solution)) return false;
    Vectors next(num_nodes, 3);
    next.row(0).setZero();
    for (int i = 1; i < num_nodes; ++i) {
      next.row(i) = solution.segment<3>(3 * (i - 1)).transpose();
    }
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
