// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>

namespace adasfm {

// CHOLMOD's supernodal factorisation of the lower triangle of a matrix that is
// in a fill-reducing order already (BlockMatrix::Reorder). Without its own
// ordering, CHOLMOD keeps no permuted copies of the matrix beside the factor,
// and no graph of its rows. It prints nothing: the caller reports failures.
class OrderedCholesky
    : public Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> {
 public:
  OrderedCholesky() {
    cholmod().print = 0;
    cholmod().nmethods = 1;
    cholmod().method[0].ordering = CHOLMOD_NATURAL;
    cholmod().postorder = false;
  }

  // After analyzePattern, by its count: the floating-point operations of a
  // factorisation, and the entries of the factor.
  double NumOperations() { return cholmod().fl; }
  double NumEntries() { return cholmod().lnz; }
  // After a factorisation: the least over the largest pivot, a rough estimate
  // of the reciprocal of the condition.
  double ReciprocalCondition() {
    return cholmod_rcond(m_cholmodFactor, &cholmod());
  }
};

}  // namespace adasfm
