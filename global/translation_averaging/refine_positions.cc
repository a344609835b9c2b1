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

EdgeTerm ComputeTerm(const TranslationAveragingOptions& options,
                     const PositionEdge& edge,
                     const Eigen::Vector3d& difference, double min_length) {
  // An edge without a length keeps the present one, with this relative sigma,
  // which damps the step and fixes the scale.
  constexpr double kFreeLengthSigma = 1.0;
  const double along = edge.direction.dot(difference);
  const bool is_free = edge.kind == PositionEdge::kFree || edge.is_redundant;
  const double length =
      std::max(min_length, is_free ? std::abs(along) : edge.length);
  const double across_sigma = length * edge.direction_sigma;
  double along_sigma = is_free ? length * kFreeLengthSigma : edge.length_sigma;
  along_sigma = std::max(along_sigma, options.min_sigma * length);
  const Eigen::Matrix3d projection =
      edge.direction * edge.direction.transpose();
  EdgeTerm term;
  term.target = (is_free ? length : edge.length) * edge.direction;
  term.information = (Eigen::Matrix3d::Identity() - projection) /
                         (across_sigma * across_sigma) +
                     projection / (along_sigma * along_sigma);
  const Eigen::Vector3d residual = difference - term.target;
  const double squared = residual.dot(term.information * residual);
  term.information /= 1.0 + squared / std::pow(options.refine_loss_scale, 2);
  return term;
}

// Supernodal: of 30,000 images the factor has tens of millions of entries. It
// prints nothing: the caller says what failed.
class QuietCholesky
    : public Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> {
 public:
  QuietCholesky() { cholmod().print = 0; }
};

// The normal equations of all centres but the first, in blocks of three.
class RefinementSystem {
 public:
  RefinementSystem(int num_nodes, const std::vector<PositionEdge>& edges)
      : edges_(edges), matrix_(3 * (num_nodes - 1), 3 * (num_nodes - 1)) {
    std::vector<Eigen::Triplet<double>> triplets;
    triplets.reserve(9 * edges.size() + 6 * num_nodes);
    for (int node = 1; node < num_nodes; ++node) {
      ListBlock(node, node, &triplets);
    }
    for (const PositionEdge& edge : edges) {
      if (edge.i == 0 || edge.j == 0) continue;
      ListBlock(std::max(edge.i, edge.j), std::min(edge.i, edge.j), &triplets);
    }
    matrix_.setFromTriplets(triplets.begin(), triplets.end());
    for (const PositionEdge& edge : edges) {
      if (edge.i == 0 || edge.j == 0) {
        offsets_.push_back(0);
        continue;
      }
      const int col = FirstColumnOf(std::min(edge.i, edge.j));
      const double* value =
          &matrix_.coeffRef(FirstColumnOf(std::max(edge.i, edge.j)), col);
      offsets_.push_back(static_cast<int>(value - StartOf(col)));
    }
    factorization_.analyzePattern(matrix_);
    Clear();
  }

  void Clear() {
    matrix_.coeffs().setZero();
    right_side_ = Eigen::VectorXd::Zero(matrix_.rows());
  }

  void Add(size_t edge_index, const EdgeTerm& term) {
    const PositionEdge& edge = edges_[edge_index];
    const Eigen::Vector3d flow = term.information * term.target;
    if (edge.i > 0) {
      AddToNode(edge.i, term.information);
      right_side_.segment<3>(FirstColumnOf(edge.i)) -= flow;
    }
    if (edge.j > 0) {
      AddToNode(edge.j, term.information);
      right_side_.segment<3>(FirstColumnOf(edge.j)) += flow;
    }
    if (edge.i == 0 || edge.j == 0) return;
    const int first = FirstColumnOf(std::min(edge.i, edge.j));
    for (int col = 0; col < 3; ++col) {
      // The diagonal's block has one value less in each further column.
      Eigen::Map<Eigen::Vector3d>(StartOf(first + col) + offsets_[edge_index] -
                                  col) -= term.information.col(col);
    }
  }

  bool Solve(Eigen::VectorXd* solution) {
    factorization_.factorize(matrix_);
    if (factorization_.info() != Eigen::Success) return false;
    *solution = factorization_.solve(right_side_);
    return solution->allFinite();
  }

 private:
  static int FirstColumnOf(int node) { return 3 * (node - 1); }

  // The lower triangle only.
  static void ListBlock(int row_node, int col_node,
                        std::vector<Eigen::Triplet<double>>* triplets) {
    for (int col = 0; col < 3; ++col) {
      for (int row = row_node == col_node ? col : 0; row < 3; ++row) {
        triplets->emplace_back(FirstColumnOf(row_node) + row,
                               FirstColumnOf(col_node) + col, 0.0);
      }
    }
  }

  double* StartOf(int col) {
    return matrix_.valuePtr() + matrix_.outerIndexPtr()[col];
  }

  void AddToNode(int node, const Eigen::Matrix3d& information) {
    for (int col = 0; col < 3; ++col) {
      double* start = StartOf(FirstColumnOf(node) + col);
      for (int row = col; row < 3; ++row)
        start[row - col] += information(row, col);
    }
  }

  const std::vector<PositionEdge>& edges_;
  Eigen::SparseMatrix<double> matrix_;
  // Of each edge, its place in the first of its columns.
  std::vector<int> offsets_;
  Eigen::VectorXd right_side_;
  QuietCholesky factorization_;
};

}  // namespace

bool RefinePositions(const TranslationAveragingOptions& options,
                     const std::vector<PositionEdge>& edges, Vectors* centers,
                     GlobalPositions* result) {
  const int num_nodes = centers->rows();
  if (num_nodes < 2) return true;
  std::vector<double> lengths;
  for (const PositionEdge& edge : edges) {
    lengths.push_back((centers->row(edge.j) - centers->row(edge.i)).norm());
  }
  const double unit = UpperMedian(&lengths);
  if (!(unit > 0.0)) return false;

  RefinementSystem system(num_nodes, edges);
  for (int k = 0; k < options.max_num_refine_iterations; ++k) {
    system.Clear();
    for (size_t e = 0; e < edges.size(); ++e) {
      const Eigen::Vector3d difference =
          (centers->row(edges[e].j) - centers->row(edges[e].i)).transpose();
      system.Add(e, ComputeTerm(options, edges[e], difference, 0.02 * unit));
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
    if (result->last_change < options.convergence_ratio) return true;
  }
  return false;
}

}  // namespace adasfm
