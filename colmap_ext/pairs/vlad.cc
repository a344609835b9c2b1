// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/vlad.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

namespace adasfm {
namespace {

// k-means has long converged by then.
constexpr int kMaxNumIterations = 30;

// A zero vector stays zero.
template <typename Vector>
void ScaleToUnitLength(Vector&& vector) {
  const float norm = vector.norm();
  if (norm > 0.0f) vector /= norm;
}

}  // namespace

RowMatrixXf TrainVocabulary(int num_words, uint64_t seed,
                            const RowMatrixXf& descriptors) {
  if (num_words < 1 || descriptors.rows() == 0) {
    throw std::invalid_argument("TrainVocabulary: no words or no descriptors");
  }
  num_words = std::min<Eigen::Index>(num_words, descriptors.rows());
  const cv::Mat samples(descriptors.rows(), descriptors.cols(), CV_32F,
                        const_cast<float*>(descriptors.data()));
  cv::Mat labels, centers;
  cv::theRNG().state = seed;
  cv::kmeans(samples, num_words, labels,
             cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS,
                              kMaxNumIterations, 1e-3),
             /*attempts=*/1, cv::KMEANS_PP_CENTERS, centers);
  return Eigen::Map<const RowMatrixXf>(centers.ptr<float>(), centers.rows,
                                       centers.cols);
}

Eigen::RowVectorXf ComputeVlad(const RowMatrixXf& vocabulary,
                               const RowMatrixXf& descriptors) {
  if (descriptors.rows() > 0 && descriptors.cols() != vocabulary.cols()) {
    throw std::invalid_argument(
        "ComputeVlad: descriptors of " + std::to_string(descriptors.cols()) +
        " dimensions, words of " + std::to_string(vocabulary.cols()));
  }
  RowMatrixXf sums = RowMatrixXf::Zero(vocabulary.rows(), vocabulary.cols());
  // |d - w|^2 = |d|^2 - 2 (d w - |w|^2 / 2): the nearest word maximises the
  // parenthesis.
  const Eigen::RowVectorXf half_norms =
      0.5f * vocabulary.rowwise().squaredNorm().transpose();
  const RowMatrixXf products = descriptors * vocabulary.transpose();
  for (Eigen::Index i = 0; i < descriptors.rows(); ++i) {
    Eigen::Index word = 0;
    (products.row(i) - half_norms).maxCoeff(&word);
    sums.row(word) += descriptors.row(i) - vocabulary.row(word);
  }
  for (Eigen::Index word = 0; word < sums.rows(); ++word) {
    sums.row(word) = sums.row(word).unaryExpr(
        [](float x) { return std::copysign(std::sqrt(std::abs(x)), x); });
    ScaleToUnitLength(sums.row(word));
  }
  Eigen::RowVectorXf vlad =
      Eigen::Map<const Eigen::RowVectorXf>(sums.data(), sums.size());
  ScaleToUnitLength(vlad);
  return vlad;
}

PcaBasis ComputePca(const RowMatrixXf& rows, int num_components) {
  if (rows.rows() == 0) throw std::invalid_argument("ComputePca: no rows");
  PcaBasis basis;
  basis.mean = rows.colwise().mean();
  const RowMatrixXf centered = rows.rowwise() - basis.mean;
  // There are few long rows: their Gram matrix gives the same components.
  const Eigen::MatrixXd gram = (centered * centered.transpose()).cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  const double max_value = solver.eigenvalues().tail(1)(0);
  const Eigen::Index num_rows = rows.rows();
  Eigen::Index num_kept = 0;
  while (num_kept < std::min<Eigen::Index>(num_components, num_rows) &&
         solver.eigenvalues()(num_rows - 1 - num_kept) > 1e-6 * max_value) {
    ++num_kept;
  }
  basis.axes.resize(rows.cols(), num_kept);
  for (Eigen::Index k = 0; k < num_kept; ++k) {
    const Eigen::Index source = num_rows - 1 - k;
    const Eigen::VectorXf weights = (solver.eigenvectors().col(source) /
                                     std::sqrt(solver.eigenvalues()(source)))
                                        .cast<float>();
    basis.axes.col(k) = centered.transpose() * weights;
  }
  return basis;
}

Eigen::RowVectorXf ReduceByPca(const PcaBasis& basis,
                               const Eigen::RowVectorXf& vector) {
  Eigen::RowVectorXf reduced = (vector - basis.mean) * basis.axes;
  ScaleToUnitLength(reduced);
  return reduced;
}

}  // namespace adasfm
