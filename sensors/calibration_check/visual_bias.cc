// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/visual_bias.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/median.h"

namespace adasfm {
namespace {

// Prior of the offset that two-view rotations of one recording share, 1 sigma,
// rad.
constexpr double kOffsetSigma = 0.0035;
// Least scatter of two-view rotations, rad.
constexpr double kMinScale = 1e-6;
constexpr double kBlockS = 2.0;
constexpr int kNumRounds = 20;

// Rows: rate and offset; columns: axes.
using Unknowns = Eigen::Matrix<double, 2, 3>;

class VisualBiasFit {
 public:
  VisualBiasFit(const RotationComparison& data, const Eigen::Matrix3d& map)
      : data_(data), weights_(data.dt_s.size(), 1.0) {
    for (size_t i = 0; i < data.dt_s.size(); ++i) {
      differences_.push_back(data.visual[i] - map * data.gyro[i]);
    }
  }

  VisualBias Run() {
    for (int round = 0; round < kNumRounds; ++round) {
      Solve();
      UpdateWeights();
    }
    return {unknowns_.row(0).transpose(), RateSigma()};
  }

 private:
  Eigen::Vector2d Row(size_t i) const { return {data_.dt_s[i], 1.0}; }
  Eigen::Vector3d Residual(size_t i) const {
    return differences_[i] - unknowns_.transpose() * Row(i);
  }

  void Solve() {
    Eigen::Matrix2d matrix = Eigen::Matrix2d::Zero();
    Unknowns sum = Unknowns::Zero();
    for (size_t i = 0; i < weights_.size(); ++i) {
      matrix += weights_[i] * Row(i) * Row(i).transpose();
      sum += weights_[i] * Row(i) * differences_[i].transpose();
    }
    matrix(1, 1) += OffsetWeight();
    inverse_ = matrix.inverse();
    unknowns_ = inverse_ * sum;
  }

  void UpdateWeights() {
    std::vector<double> lengths;
    for (size_t i = 0; i < weights_.size(); ++i) {
      lengths.push_back(Residual(i).norm());
    }
    std::vector<double> sorted = lengths;
    scale_ = std::max(kMinScale, UpperMedian(&sorted) / kMedianNorm3);
    for (size_t i = 0; i < weights_.size(); ++i) {
      weights_[i] =
          1.0 / (1.0 + std::pow(lengths[i] / (kLossScale * scale_), 2));
    }
  }

  // The weight of the offset's prior, where an interval has weight 1.
  double OffsetWeight() const {
    return scale_ * scale_ / (kOffsetSigma * kOffsetSigma);
  }

  double RateSigma() const {
    Unknowns influence = Unknowns::Zero();
    Unknowns squares = Unknowns::Zero();
    int num_blocks = 0;
    for (size_t i = 0; i < weights_.size(); ++i) {
      influence += inverse_ * weights_[i] * Row(i) * Residual(i).transpose();
      const bool is_last = i + 1 == weights_.size();
      if (!is_last && Block(i + 1) == Block(i)) continue;
      squares += influence.cwiseAbs2();
      influence.setZero();
      ++num_blocks;
    }
    if (num_blocks < 3) return std::numeric_limits<double>::infinity();
    const double of_prior =
        std::pow(inverse_(0, 1) * OffsetWeight() * kOffsetSigma, 2);
    return std::sqrt(squares.row(0).mean() * num_blocks / (num_blocks - 2.0) +
                     of_prior);
  }

  int Block(size_t i) const {
    return static_cast<int>((data_.start_s[i] - data_.start_s[0]) / kBlockS);
  }

  static constexpr double kLossScale = 2.0;

  const RotationComparison& data_;
  std::vector<Eigen::Vector3d> differences_;
  std::vector<double> weights_;
  double scale_ = kOffsetSigma;
  Eigen::Matrix2d inverse_ = Eigen::Matrix2d::Zero();
  Unknowns unknowns_ = Unknowns::Zero();
};

}  // namespace

VisualBias EstimateVisualBias(const RotationComparison& data,
                              const Eigen::Matrix3d& map) {
  if (data.dt_s.size() < 2) return VisualBias();
  return VisualBiasFit(data, map).Run();
}

}  // namespace adasfm
