// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_sdp.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/nearest_rotation.h"
#include "global/rotation_averaging/rotation_certificate.h"
#include "global/rotation_averaging/rotation_sdp_problem.h"

namespace adasfm {
namespace {

// The nearest matrix with orthonormal rows.
RotationBlock PolarFactor(const RotationBlock& matrix) {
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

void Descend(const RotationSdpOptions& options,
             const RotationSdpProblem& problem,
             std::vector<RotationBlock>* blocks) {
  double cost = problem.Cost(*blocks);
  for (int sweep = 0; sweep < options.max_num_sweeps; ++sweep) {
    for (size_t i = 0; i < problem.size(); ++i) {
      const RotationBlock sum = problem.Sum(*blocks, i);
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

Eigenpair SmallestEigenpair(const RotationSdpProblem& problem,
                            const std::vector<RotationBlock>& blocks) {
  constexpr int kMaxNumVectors = 40;
  const int size = 3 * static_cast<int>(problem.size());
  std::vector<Eigen::Matrix3d> multipliers(problem.size());
  for (size_t i = 0; i < problem.size(); ++i) {
    multipliers[i] = problem.Multiplier(blocks, i);
  }
  const auto apply = [&](const Eigen::VectorXd& vector) {
    std::vector<RotationBlock> columns(problem.size());
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

// Round-off.
double NegligibleCost(const std::vector<RotationEdge>& edges) {
  return 1e-12 * edges.size();
}

// One more column, along the direction of negative curvature.
void RaiseRank(const Eigen::VectorXd& direction,
               std::vector<RotationBlock>* blocks) {
  constexpr double kStep = 0.1;
  const double scale = kStep * std::sqrt(static_cast<double>(blocks->size()));
  for (size_t i = 0; i < blocks->size(); ++i) {
    RotationBlock& block = (*blocks)[i];
    block.conservativeResize(Eigen::NoChange, block.cols() + 1);
    block.rightCols<1>() = scale * direction.segment<3>(3 * i);
    block = PolarFactor(block);
  }
}

std::vector<Eigen::Matrix3d> RoundToRotations(
    const std::vector<RotationBlock>& blocks) {
  const Eigen::Index rank = blocks.front().cols();
  Eigen::MatrixXd moments = Eigen::MatrixXd::Zero(rank, rank);
  for (const RotationBlock& block : blocks)
    moments += block.transpose() * block;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(moments);
  Eigen::MatrixXd main_axes = eigen.eigenvectors().rightCols<3>();
  double sum_determinants = 0.0;
  for (const RotationBlock& block : blocks) {
    sum_determinants += Eigen::Matrix3d(block * main_axes).determinant();
  }
  if (sum_determinants < 0.0) main_axes.col(0) *= -1.0;
  std::vector<Eigen::Matrix3d> rotations;
  for (const RotationBlock& block : blocks) {
    rotations.push_back(NearestRotation(block * main_axes));
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
  const RotationSdpProblem problem(edges, start.size());
  std::vector<RotationBlock> blocks(start.begin(), start.end());
  const double negligible = NegligibleCost(edges);
  Eigenpair smallest;
  while (true) {
    Descend(options, problem, &blocks);
    smallest = SmallestEigenpair(problem, blocks);
    solution.cost = std::max(0.0, problem.Cost(blocks));
    solution.rank = blocks.front().cols();
    const double gap = 3.0 * blocks.size() * std::max(0.0, -smallest.value);
    if (gap <= 1e-3 * solution.cost + negligible) break;
    if (solution.rank >= options.max_rank) break;
    RaiseRank(smallest.vector, &blocks);
  }
  // All matrices of the relaxation have the trace 3 n, which bounds their cost.
  const double bound = BoundNegativeEigenvalue(
      CertificateMatrix(problem, blocks), std::max(0.0, -smallest.value));
  solution.lower_bound =
      std::max(0.0, solution.cost - 3.0 * blocks.size() * bound);
  solution.rotations = RoundToRotations(blocks);
  // Of the rotations, not of the relaxation: rounding may increase the cost.
  solution.optimality =
      ComputeOptimality(edges, solution.rotations, solution.lower_bound);
  return solution;
}

double ComputeOptimality(const std::vector<RotationEdge>& edges,
                         const std::vector<Eigen::Matrix3d>& rotations,
                         double lower_bound) {
  const double cost =
      RotationSdpProblem(edges, rotations.size())
          .Cost(std::vector<RotationBlock>(rotations.begin(), rotations.end()));
  return cost <= NegligibleCost(edges) ? 1.0
                                       : std::min(1.0, lower_bound / cost);
}

}  // namespace adasfm
