// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/vlad.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "colmap_ext/pairs/nearest_rows.h"
#include "core/random.h"

namespace adasfm {
namespace {

RowMatrixXf RandomRows(int num_rows, int num_columns, Random* random) {
  RowMatrixXf rows(num_rows, num_columns);
  for (Eigen::Index i = 0; i < rows.size(); ++i) {
    rows.data()[i] = random->Gaussian(1.0);
  }
  return rows;
}

// VLAD by its definition, with loops.
Eigen::RowVectorXf VladByLoops(const RowMatrixXf& words,
                               const RowMatrixXf& descriptors) {
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(words.rows(), words.cols());
  for (int i = 0; i < descriptors.rows(); ++i) {
    int nearest = 0;
    for (int k = 1; k < words.rows(); ++k) {
      if ((descriptors.row(i) - words.row(k)).norm() <
          (descriptors.row(i) - words.row(nearest)).norm()) {
        nearest = k;
      }
    }
    sums.row(nearest) +=
        (descriptors.row(i) - words.row(nearest)).cast<double>();
  }
  Eigen::RowVectorXf vlad(words.size());
  for (int k = 0; k < words.rows(); ++k) {
    for (int c = 0; c < words.cols(); ++c) {
      const double x = sums(k, c);
      sums(k, c) = x < 0.0 ? -std::sqrt(-x) : std::sqrt(x);
    }
    const double norm = sums.row(k).norm();
    for (int c = 0; c < words.cols(); ++c) {
      vlad(k * words.cols() + c) = norm > 0.0 ? sums(k, c) / norm : 0.0;
    }
  }
  return vlad / vlad.norm();
}

TEST(Vlad, EqualsItsDefinition) {
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    const RowMatrixXf words = RandomRows(7, 5, &random);
    const RowMatrixXf descriptors = RandomRows(40, 5, &random);
    EXPECT_LT(
        (ComputeVlad(words, descriptors) - VladByLoops(words, descriptors))
            .norm(),
        1e-4);
  }
}

TEST(Vlad, OrderDoesNotMatterAndNothingIsZero) {
  Random random(1);
  const RowMatrixXf words = RandomRows(4, 3, &random);
  const RowMatrixXf descriptors = RandomRows(30, 3, &random);
  EXPECT_LT((ComputeVlad(words, descriptors) -
             ComputeVlad(words, descriptors.colwise().reverse()))
                .norm(),
            1e-5);
  EXPECT_TRUE(ComputeVlad(words, RowMatrixXf(0, 3)).isZero());
  EXPECT_THROW(ComputeVlad(words, RandomRows(2, 4, &random)),
               std::invalid_argument);
}

TEST(Vocabulary, FindsClustersAndRepeatsItself) {
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    // Six tight clusters, far from each other.
    RowMatrixXf centers = 100.0f * RandomRows(6, 8, &random);
    RowMatrixXf rows(6 * 50, 8);
    for (int i = 0; i < rows.rows(); ++i) {
      rows.row(i) = centers.row(i % 6) + RandomRows(1, 8, &random);
    }
    const RowMatrixXf words = TrainVocabulary(6, seed, rows);
    ASSERT_EQ(words.rows(), 6);
    for (int k = 0; k < 6; ++k) {
      // The mean of 50 rows in 8 dimensions is within five of its sigmas.
      EXPECT_LT((words.rowwise() - centers.row(k)).rowwise().norm().minCoeff(),
                5.0 * std::sqrt(8.0 / 50.0));
    }
    EXPECT_EQ(words, TrainVocabulary(6, seed, rows));
  }
}

TEST(Vocabulary, FewDescriptorsGiveFewWords) {
  Random random(1);
  EXPECT_EQ(TrainVocabulary(64, 1, RandomRows(3, 4, &random)).rows(), 3);
  EXPECT_THROW(TrainVocabulary(64, 1, RowMatrixXf(0, 4)),
               std::invalid_argument);
}

TEST(Vocabulary, TheSeedCounts) {
  Random random(1);
  const RowMatrixXf rows = RandomRows(300, 4, &random);
  EXPECT_NE(TrainVocabulary(10, 1, rows), TrainVocabulary(10, 2, rows));
}

TEST(Pca, KeepsWhatVaries) {
  Random random(1);
  // Rows in a plane of three dimensions, in twenty.
  const RowMatrixXf axes = RandomRows(3, 20, &random);
  const RowMatrixXf rows = RandomRows(12, 3, &random) * axes;
  const PcaBasis basis = ComputePca(rows, 10);
  ASSERT_EQ(basis.axes.cols(), 3);
  EXPECT_TRUE((basis.axes.transpose() * basis.axes).isIdentity(1e-4));
  const RowMatrixXf centered = rows.rowwise() - basis.mean;
  EXPECT_LT((centered * basis.axes * basis.axes.transpose() - centered).norm(),
            1e-3 * centered.norm());
  EXPECT_NEAR(ReduceByPca(basis, rows.row(0)).norm(), 1.0, 1e-5);
}

TEST(NearestRows, EqualBruteForce) {
  for (const uint64_t seed : {1, 2}) {
    Random random(seed);
    const RowMatrixXf rows = RandomRows(300, 16, &random);
    const std::vector<std::vector<int>> nearest = FindNearestRows(rows, 5, 2);
    ASSERT_EQ(nearest.size(), 300);
    for (int i = 0; i < rows.rows(); ++i) {
      std::vector<std::pair<float, int>> all;
      for (int k = 0; k < rows.rows(); ++k) {
        if (k != i) {
          all.emplace_back((rows.row(i) - rows.row(k)).squaredNorm(), k);
        }
      }
      std::sort(all.begin(), all.end());
      ASSERT_EQ(nearest[i].size(), 5);
      for (int n = 0; n < 5; ++n) EXPECT_EQ(nearest[i][n], all[n].second);
    }
  }
}

TEST(NearestRows, EqualRowsAndFewRows) {
  const RowMatrixXf same = RowMatrixXf::Ones(4, 3);
  for (const std::vector<int>& found : FindNearestRows(same, 2, 1)) {
    EXPECT_EQ(found.size(), 2);
  }
  EXPECT_EQ(FindNearestRows(same, 30, 1)[0].size(), 3);
  EXPECT_TRUE(FindNearestRows(RowMatrixXf::Ones(1, 3), 2, 1)[0].empty());
}

}  // namespace
}  // namespace adasfm
