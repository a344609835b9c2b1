// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_sdp.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace adasfm {
namespace {

constexpr int kMaxRank = 12;
using Block = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxRank>;

// Both directions of every edge, by node, with weights whose largest node sum
// is of order one.
struct Neighbour {
  int node = 0;
  Eigen::Matrix3d weighted_rotation;  // node -> this one
};

class Problem {
 public:
  Problem(const std::vector<RotationEdge>& edges, size_t num_nodes)
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

  Block Sum(const std::vector<Block>& blocks, size_t i) const {
    Block sum = Block::Zero(3, blocks[i].cols());
    for (const Neighbour& neighbour : neighbours_[i]) {
      sum.noalias() += neighbour.weighted_rotation * blocks[neighbour.node];
    }
    return sum;
  }

  // sum of w |R_j - R_ij R_i|^2.
  double Cost(const std::vector<Block>& blocks) const {
    double gain = 0.0;
    for (size_t i = 0; i < size(); ++i) {
      gain += Sum(blocks, i).cwiseProduct(blocks[i]).sum();
    }
    return 6.0 * sum_weights_ - gain;
  }

 private:
  std::vector<std::vector<Neighbour>> neighbours_;
  double sum_weights_ = 0.0;
};

// The nearest matrix with orthonormal rows.
Block PolarFactor(const Block& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
      matrix * matrix.transpose());
  const Eigen::Vector3d& values = eigen.eigenvalues();
  if (values(0) > 1e-8 * values(2)) {
    return eigen.eigenvectors() *
           values.cwiseSqrt().cwiseInverse().asDiagonal() *
           eigen.eigenvectors().transpose() * matrix;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(
      matrix, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.matrixU() * svd.matrixV().transpose();
}

void Descend(const RotationSdpOptions& options, const Problem& problem,
             std::vector<Block>* blocks) {
  double cost = problem.Cost(*blocks);
  for (int sweep = 0; sweep < options.max_num_sweeps; ++sweep) {
    for (size_t i = 0; i < problem.size(); ++i) {
      const Block sum = problem.Sum(*blocks, i);
      if (sum.squaredNorm() > 0.0) (*blocks)[i] = PolarFactor(sum);
    }
    const double new_cost = problem.Cost(*blocks);
    if (!(cost - new_cost > options.tolerance * std::abs(cost))) break;
    cost = new_cost;
  }
}

// The smallest eigenvalue and its vector of S = Lambda - W by Lanczos with full
// reorthogonalisation; Lambda_i is the symmetric part of Sum_i Y_i^T.
struct Eigenpair {
  double value = 0.0;
  Eigen::VectorXd vector;
};

Eigenpair SmallestEigenpair(const Problem& problem,
                            const std::vector<Block>& blocks) {
  constexpr int kMaxNumVectors = 40;
  const int size = 3 * static_cast<int>(problem.size());
  std::vector<Eigen::Matrix3d> multipliers(problem.size());
  for (size_t i = 0; i < problem.size(); ++i) {
    const Eigen::Matrix3d product =
        problem.Sum(blocks, i) * blocks[i].transpose();
    multipliers[i] = 0.5 * (product + product.transpose());
  }
  const auto apply = [&](const Eigen::VectorXd& vector) {
    std::vector<Block> columns(problem.size());
    for (size_t i = 0; i < problem.size(); ++i) {
      columns[i] = vector.segment<3>(3 * i);
    }
    Eigen::VectorXd product(size);
    for (size_t i = 0; i < problem.size(); ++i) {
      product.segment<3>(3 * i) =
          multipliers[i] * columns[i] - problem.Sum(columns, i);
    }
    return product;
  };

  const int num_vectors = std::min(kMaxNumVectors, size);
  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(size, num_vectors);
  Eigen::MatrixXd projected = Eigen::MatrixXd::Zero(num_vectors, num_vectors);
  // Any start with parts along all vectors serves.
  Eigen::VectorXd vector(size);
  for (int k = 0; k < size; ++k) vector(k) = std::sin(1.0 + 0.7 * k * k);
  int count = 0;
  while (count < num_vectors) {
    for (int pass = 0; pass < 2; ++pass) {
      vector -=
          basis.leftCols(count) * (basis.leftCols(count).transpose() * vector);
    }
    if (!(vector.norm() > 1e-10)) break;
    basis.col(count) = vector.normalized();
    vector = apply(basis.col(count));
    const double norm = vector.norm();
    ++count;
    projected.topRows(count).col(count - 1) =
        basis.leftCols(count).transpose() * vector;
    if (!(norm > 1e-14)) break;
  }
  Eigenpair pair;
  if (count == 0) return pair;
  const Eigen::MatrixXd symmetric =
      projected.topLeftCorner(count, count).selfadjointView<Eigen::Upper>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
  pair.value = eigen.eigenvalues()(0);
  pair.vector = basis.leftCols(count) * eigen.eigenvectors().col(0);
  return pair;
}

// One more column, along the direction of negative curvature.
void RaiseRank(const Eigen::VectorXd& direction, std::vector<Block>* blocks) {
  constexpr double kStep = 0.1;
  const double scale = kStep * std::sqrt(static_cast<double>(blocks->size()));
  for (size_t i = 0; i < blocks->size(); ++i) {
    Block& block = (*blocks)[i];
    block.conservativeResize(Eigen::NoChange, block.cols() + 1);
    block.rightCols<1>() = scale * direction.segment<3>(3 * i);
    block = PolarFactor(block);
  }
}

std::vector<Eigen::Matrix3d> RoundToRotations(
    const std::vector<Block>& blocks) {
  const Eigen::Index rank = blocks.front().cols();
  Eigen::MatrixXd moments = Eigen::MatrixXd::Zero(rank, rank);
  for (const Block& block : blocks) moments += block.transpose() * block;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(moments);
  Eigen::MatrixXd main_axes = eigen.eigenvectors().rightCols<3>();
  double sum_determinants = 0.0;
  for (const Block& block : blocks) {
    sum_determinants += Eigen::Matrix3d(block * main_axes).determinant();
  }
  if (sum_determinants < 0.0) main_axes.col(0) *= -1.0;
  std::vector<Eigen::Matrix3d> rotations;
  for (const Block& block : blocks) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
        block * main_axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs = Eigen::Vector3d::Ones();
    signs(2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    rotations.push_back(svd.matrixU() * signs.asDiagonal() *
                        svd.matrixV().transpose());
  }
  return rotations;
}

}  // namespace

RotationSdpSolution SolveRotationSdp(
    const RotationSdpOptions& options, const std::vector<RotationEdge>& edges,
    const std::vector<Eigen::Matrix3d>& start) {
  RotationSdpSolution solution;
  solution.rotations = start;
  if (start.empty() || edges.empty()) return solution;
  const Problem problem(edges, start.size());
  std::vector<Block> blocks;
  for (const Eigen::Matrix3d& rotation : start) {
    Block block = Block::Zero(3, options.min_rank);
    block.leftCols<3>() = rotation;
    blocks.push_back(block);
  }
  while (true) {
    Descend(options, problem, &blocks);
    const Eigenpair smallest = SmallestEigenpair(problem, blocks);
    const double cost = std::max(0.0, problem.Cost(blocks));
    const double gap = 3.0 * blocks.size() * std::max(0.0, -smallest.value);
    // Costs of this order are round-off.
    const double negligible = 1e-12 * edges.size();
    solution.rank = blocks.front().cols();
    solution.optimality = std::clamp(1.0 - gap / (cost + negligible), 0.0, 1.0);
    if (cost <= negligible) solution.optimality = 1.0;
    if (solution.optimality > 1.0 - 1e-3) break;
    if (solution.rank >= options.max_rank) break;
    RaiseRank(smallest.vector, &blocks);
  }
  solution.rotations = RoundToRotations(blocks);
  return solution;
}

}  // namespace adasfm
