// SPDX-License-Identifier: BSD-3-Clause
#include "global/rotation_averaging/rotation_certificate.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace adasfm {
namespace {

Eigen::SparseMatrix<double> Identity(Eigen::Index size) {
  Eigen::SparseMatrix<double> identity(size, size);
  identity.setIdentity();
  return identity;
}

// gamma / (1 - gamma) trace, gamma = (k + 1) u / (1 - (k + 1) u): what a
// floating-point Cholesky factorisation that runs to its end may hide.
double RoundOffMargin(Eigen::Index size, double trace) {
  const double ku = (size + 1) * std::numeric_limits<double>::epsilon() / 2.0;
  const double gamma = ku / (1.0 - ku);
  return gamma / (1.0 - gamma) * trace;
}

}  // namespace

Eigen::SparseMatrix<double> CertificateMatrix(
    const RotationSdpProblem& problem,
    const std::vector<RotationBlock>& blocks) {
  std::vector<Eigen::Triplet<double>> triplets;
  const auto add = [&triplets](int i, int j, const Eigen::Matrix3d& block) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        if (3 * i + row < 3 * j + column) continue;
        triplets.emplace_back(3 * i + row, 3 * j + column, block(row, column));
      }
    }
  };
  for (size_t i = 0; i < problem.size(); ++i) {
    add(i, i, problem.Multiplier(blocks, i));
    for (const auto& neighbour : problem.Neighbours(i)) {
      if (neighbour.node < static_cast<int>(i)) {
        add(i, neighbour.node, -neighbour.weighted_rotation);
      }
    }
  }
  const Eigen::Index size = 3 * problem.size();
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  return matrix;
}

double BoundNegativeEigenvalue(const Eigen::SparseMatrix<double>& matrix,
                               double guess) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Eigen::Index size = matrix.rows();
  if (size == 0) return 0.0;
  // No eigenvalue is larger than the Frobenius norm of both triangles.
  const double largest = std::sqrt(2.0) * matrix.norm();
  if (!(largest < kInfinity)) return kInfinity;
  if (largest == 0.0) return 0.0;
  const Eigen::SparseMatrix<double> identity = Identity(size);
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factorization;
  factorization.analyzePattern(matrix + identity);
  constexpr double kGrowth = 2.0;
  for (double shift = std::max(1.1 * guess, 1e-15 * largest);;
       shift = std::min(kGrowth * shift, 1.1 * largest)) {
    const Eigen::SparseMatrix<double> shifted = matrix + shift * identity;
    factorization.factorize(shifted);
    if (factorization.info() == Eigen::Success) {
      return shift + RoundOffMargin(size, shifted.diagonal().sum());
    }
    if (shift >= 1.1 * largest) return kInfinity;
  }
}

}  // namespace adasfm
