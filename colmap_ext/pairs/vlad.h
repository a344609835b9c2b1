// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace adasfm {

// One vector per row.
using RowMatrixXf =
    Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Words x dimensions: the centres of k-means (with k-means++ start) over the
// rows. Fewer rows than num_words give fewer words. The same rows and seed give
// the same vocabulary. Throws std::invalid_argument without rows or words.
RowMatrixXf TrainVocabulary(int num_words, uint64_t seed,
                            const RowMatrixXf& descriptors);

// The vector of locally aggregated descriptors of one image (Jegou et al.
// 2010), a row of words x dimensions numbers. For every word, sums (descriptor
// - word) over the descriptors nearest to the word, takes signed square roots
// and scales the result to unit length (Arandjelovic & Zisserman 2013: bursts
// of one texture count once); then scales the whole vector to unit length.
// Zeros without descriptors. Throws std::invalid_argument when the dimensions
// of descriptors and words differ.
Eigen::RowVectorXf ComputeVlad(const RowMatrixXf& vocabulary,
                               const RowMatrixXf& descriptors);

// Principal components: reduced = (vector - mean) * axes, scaled to unit
// length.
struct PcaBasis {
  Eigen::RowVectorXf mean;
  RowMatrixXf axes;  // dimensions x reduced dimensions
};

// Components of the rows; fewer of them than rows.
PcaBasis ComputePca(const RowMatrixXf& rows, int num_components);
Eigen::RowVectorXf ReduceByPca(const PcaBasis& basis,
                               const Eigen::RowVectorXf& vector);

}  // namespace adasfm
