// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <new>

#include "core/sparse/huge_pages.h"

namespace adasfm {

// CHOLMOD's supernodal factorisation of the lower triangle of a matrix that is
// in a fill-reducing order already (BlockMatrix::Reorder). Without its own
// ordering, CHOLMOD keeps no permuted copies of the matrix beside the factor,
// and no graph of its rows. It prints nothing: the caller reports failures.
class OrderedCholesky
    : public Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> {
  using Base = Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>>;

 public:
  OrderedCholesky() {
    cholmod().print = 0;
    cholmod().nmethods = 1;
    cholmod().method[0].ordering = CHOLMOD_NATURAL;
    cholmod().postorder = false;
  }

  // Allocates the factor, too. Throws where memory is short, which Eigen takes
  // for success, as does factorize().
  void analyzePattern(const Eigen::SparseMatrix<double>& matrix) {
    Base::analyzePattern(matrix);
    CheckMemory();
    cholmod_change_factor(CHOLMOD_REAL, true, true, true, true, m_cholmodFactor,
                          &cholmod());
    CheckMemory();
    AdviseHugePages(m_cholmodFactor->x,
                    m_cholmodFactor->xsize * sizeof(double));
  }

  void factorize(const Eigen::SparseMatrix<double>& matrix) {
    Base::factorize(matrix);
    CheckMemory();
  }

  // After a factorisation that succeeded. Throws where memory is short, too:
  // Eigen's returns numbers that were never set.
  template <typename Right>
  typename Right::PlainObject solve(
      const Eigen::MatrixBase<Right>& right_side) const {
    typename Right::PlainObject solution = Base::solve(right_side);
    if (Base::info() != Eigen::Success) throw std::bad_alloc();
    return solution;
  }

  // Eigen's would call its own two.
  void compute(const Eigen::SparseMatrix<double>& matrix) = delete;

  // After analyzePattern, by its count: the floating-point operations of a
  // factorisation, and the entries of the factor.
  double NumOperations() { return cholmod().fl; }
  double NumEntries() { return cholmod().lnz; }
  // After a factorisation: the least over the largest pivot, a rough estimate
  // of the reciprocal of the condition.
  double ReciprocalCondition() {
    return cholmod_rcond(m_cholmodFactor, &cholmod());
  }

 private:
  void CheckMemory() {
    if (m_cholmodFactor == nullptr ||
        cholmod().status == CHOLMOD_OUT_OF_MEMORY) {
      throw std::bad_alloc();
    }
  }
};

}  // namespace adasfm
