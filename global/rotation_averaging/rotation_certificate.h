// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "global/rotation_averaging/rotation_sdp_problem.h"

namespace adasfm {

// S = Lambda - W of the relaxation at Y (Chen et al. 2021, Eriksson et al.
// 2018), 3 n x 3 n, lower triangle. Lambda is feasible in the dual as far as S
// has no negative eigenvalue.
Eigen::SparseMatrix<double> CertificateMatrix(
    const RotationSdpProblem& problem,
    const std::vector<RotationBlock>& blocks);

// A number b >= 0 with lambda_min(S) >= -b for a symmetric matrix given by its
// lower triangle: S + b I has a Cholesky factor, with the margin of Rump (2006)
// for what round-off could hide. The search starts at `guess` >= 0; infinity
// when even a shift by the matrix's norm fails (NaN).
double BoundNegativeEigenvalue(const Eigen::SparseMatrix<double>& matrix,
                               double guess);

}  // namespace adasfm
