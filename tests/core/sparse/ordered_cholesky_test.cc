// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/ordered_cholesky.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <fstream>
#include <new>
#include <random>

namespace adasfm {
namespace {

// The lower triangle of a positive definite matrix without zeros.
Eigen::SparseMatrix<double> DenseTriangle(int size, int seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.reserve(size * (size + 1) / 2);
  for (int col = 0; col < size; ++col) {
    matrix.startVec(col);
    matrix.insertBack(col, col) = 10.0 * size;
    for (int row = col + 1; row < size; ++row) {
      matrix.insertBack(row, col) = normal(random);
    }
  }
  matrix.finalize();
  return matrix;
}

TEST(OrderedCholesky, SolvesForEachMatrixOfAPattern) {
  const int size = 60;
  const Eigen::VectorXd right_side = Eigen::VectorXd::LinSpaced(size, -1, 1);
  OrderedCholesky factor;
  factor.analyzePattern(DenseTriangle(size, 1));
  for (const int seed : {1, 2, 3}) {
    const Eigen::SparseMatrix<double> matrix = DenseTriangle(size, seed);
    factor.factorize(matrix);
    ASSERT_EQ(factor.info(), Eigen::Success);
    const Eigen::MatrixXd whole =
        Eigen::MatrixXd(matrix).selfadjointView<Eigen::Lower>();
    EXPECT_LT((whole * factor.solve(right_side) - right_side).norm(), 1e-12);
  }
}

TEST(OrderedCholesky, TellsAMatrixThatIsNotPositiveDefinite) {
  Eigen::SparseMatrix<double> matrix = DenseTriangle(20, 1);
  matrix.coeffRef(7, 7) = -1.0;
  OrderedCholesky factor;
  factor.analyzePattern(matrix);
  factor.factorize(matrix);
  EXPECT_NE(factor.info(), Eigen::Success);
}

// The process may map so many more bytes.
class AddressLimit {
 public:
  explicit AddressLimit(size_t num_bytes) {
    size_t num_pages = 0;
    std::ifstream("/proc/self/statm") >> num_pages;
    getrlimit(RLIMIT_AS, &before_);
    rlimit limit = before_;
    limit.rlim_cur = num_pages * sysconf(_SC_PAGESIZE) + num_bytes;
    is_set_ = setrlimit(RLIMIT_AS, &limit) == 0;
  }
  ~AddressLimit() { setrlimit(RLIMIT_AS, &before_); }
  bool IsSet() const { return is_set_; }

 private:
  rlimit before_;
  bool is_set_ = false;
};

TEST(OrderedCholesky, ThrowsWhereMemoryIsShort) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer aborts where memory is short.";
#endif
  // The factor takes 72 MB.
  const Eigen::SparseMatrix<double> matrix = DenseTriangle(3000, 1);
  OrderedCholesky factor;
  {
    const AddressLimit limit(32 << 20);
    ASSERT_TRUE(limit.IsSet());
    EXPECT_THROW(factor.analyzePattern(matrix), std::bad_alloc);
  }
  factor.analyzePattern(matrix);
  factor.factorize(matrix);
  EXPECT_EQ(factor.info(), Eigen::Success);
}

}  // namespace
}  // namespace adasfm
