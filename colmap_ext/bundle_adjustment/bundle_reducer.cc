// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_reducer.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "colmap_ext/bundle_adjustment/damping.h"

namespace adasfm {

BundleReducer::BundleReducer(BundleProblem* bundle, int num_threads)
    : bundle_(*bundle),
      problem_(*bundle->CeresProblem()),
      num_threads_(num_threads) {
  problem_.GetResidualBlocks(&ids_);
  NumberBlocks();
  FindPattern();
  OrderBlocks();
  matrix_.Allocate();
  column_of_block_.assign(matrix_.NumBlocks(), -1);
}

int BundleReducer::AddBlock(double* parameters, int size) {
  const auto [entry, is_new] =
      block_of_.emplace(parameters, matrix_.NumBlocks());
  if (!is_new) return entry->second;
  parameters_of_.push_back(parameters);
  return matrix_.AddBlock(size);
}

// Ceres would list parameters by their addresses, which differ in every run.
void BundleReducer::NumberBlocks() {
  for (AdjustedPose& pose : bundle_.Poses()) {
    const bool is_free = problem_.HasParameterBlock(pose.parameters) &&
                         !problem_.IsParameterBlockConstant(pose.parameters);
    block_of_pose_.push_back(is_free ? AddBlock(pose.parameters, 6) : -1);
  }
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId id : ids_) {
    problem_.GetParameterBlocksForResidualBlock(id, &blocks);
    for (double* block : blocks) {
      if (bundle_.IsPoint(block) || problem_.IsParameterBlockConstant(block)) {
        continue;
      }
      AddBlock(block, problem_.ParameterBlockTangentSize(block));
    }
  }
}

// Adds each pair once, image by image, as mostly the same other images see the
// points of an image.
void BundleReducer::AddPairsOfPoints() {
  const size_t num_points = bundle_.NumPointsApart();
  const auto block_of = [&](const PointObservation& observation) {
    return block_of_pose_[observation.pose - bundle_.Poses().data()];
  };
  std::vector<std::vector<int>> points_of(matrix_.NumBlocks());
  for (size_t k = 0; k < num_points; ++k) {
    for (const PointObservation& observation : bundle_.ObservationsOf(k)) {
      const int block = block_of(observation);
      if (block >= 0) points_of[block].push_back(k);
    }
  }
  std::vector<int> last_pair(matrix_.NumBlocks(), -1);
  for (int block = 0; block < matrix_.NumBlocks(); ++block) {
    for (const int k : points_of[block]) {
      for (const PointObservation& observation : bundle_.ObservationsOf(k)) {
        const int other = block_of(observation);
        if (other <= block || last_pair[other] == block) continue;
        last_pair[other] = block;
        matrix_.AddPair(block, other);
      }
    }
    points_of[block] = {};
  }
}

void BundleReducer::FindPattern() {
  AddPairsOfPoints();
  std::vector<int> blocks;
  const double* last_point = nullptr;
  for (const ceres::ResidualBlockId id : ids_) {
    problem_.GetParameterBlocksForResidualBlock(id, &parameters_);
    const double* point = nullptr;
    for (const double* block : parameters_) {
      if (bundle_.IsPoint(block)) point = block;
    }
    if (point == nullptr || point != last_point) blocks.clear();
    last_point = point;
    for (const double* block : parameters_) {
      const auto found = block_of_.find(block);
      if (found == block_of_.end()) continue;
      for (const int other : blocks) matrix_.AddPair(other, found->second);
      if (std::find(blocks.begin(), blocks.end(), found->second) ==
          blocks.end()) {
        blocks.push_back(found->second);
      }
    }
  }
}

void BundleReducer::OrderBlocks() {
  const std::vector<int> number_of = matrix_.Reorder();
  std::vector<double*> parameters_of(parameters_of_.size());
  for (size_t block = 0; block < parameters_of.size(); ++block) {
    parameters_of[number_of[block]] = parameters_of_[block];
  }
  parameters_of_ = std::move(parameters_of);
  for (auto& [parameters, block] : block_of_) block = number_of[block];
  for (int& block : block_of_pose_) {
    if (block >= 0) block = number_of[block];
  }
}

double BundleReducer::Linearize(double inverse_radius,
                                std::vector<ReducedPriorRows>* priors) {
  inverse_radius_ = inverse_radius;
  matrix_.Matrix().coeffs().setZero();
  gradient_.setZero(matrix_.NumColumns());
  whole_gradient_ = gradient_;
  diagonal_ = gradient_;
  bundle_.UpdatePoses();
  const Totals totals = LinearizePoints();
  double cost = totals.cost;
  const std::vector<BundleProblem::PriorBlock>& listed = bundle_.PriorBlocks();
  size_t num_listed = 0;
  for (const ceres::ResidualBlockId id : ids_) {
    const bool is_prior = priors != nullptr && num_listed < listed.size() &&
                          listed[num_listed].residual == id;
    cost += Evaluate(id, !is_prior);
    if (is_prior) {
      priors->push_back(PriorRows(listed[num_listed++]));
      continue;
    }
    AddRows();
    if (point_ != nullptr) AddPointRows();
  }
  EliminateListedPoint();
  if (scales_.size() == 0) scales_ = DampingScales(diagonal_);
  DampPoses();
  largest_gradient_ = std::max(totals.largest_gradient,
                               whole_gradient_.lpNorm<Eigen::Infinity>());
  return cost;
}

void BundleReducer::DampPoses() {
  if (inverse_radius_ == 0.0) return;
  const Eigen::VectorXd damping = Damping(diagonal_, scales_, inverse_radius_);
  Eigen::SparseMatrix<double>& matrix = matrix_.Matrix();
  for (int col = 0; col < matrix.cols(); ++col) {
    matrix.valuePtr()[matrix.outerIndexPtr()[col]] += damping[col];
  }
}

double BundleReducer::Evaluate(ceres::ResidualBlockId id, bool is_robust) {
  problem_.GetParameterBlocksForResidualBlock(id, &parameters_);
  const int num_rows =
      problem_.GetCostFunctionForResidualBlock(id)->num_residuals();
  residuals_.resize(num_rows);
  blocks_.clear();
  blocks_.reserve(parameters_.size());
  pointers_.assign(parameters_.size(), nullptr);
  point_ = nullptr;
  for (size_t k = 0; k < parameters_.size(); ++k) {
    if (bundle_.IsPoint(parameters_[k])) {
      point_ = parameters_[k];
      by_point_.resize(num_rows, 3);
      pointers_[k] = by_point_.data();
      continue;
    }
    const auto block = block_of_.find(parameters_[k]);
    if (block == block_of_.end()) continue;
    blocks_.push_back(
        {block->second,
         RowMajorMatrix(num_rows, matrix_.SizeOf(block->second))});
    pointers_[k] = blocks_.back().values.data();
  }
  double cost = 0.0;
  problem_.EvaluateResidualBlockAssumingParametersUnchanged(
      id, is_robust, &cost, residuals_.data(), pointers_.data());
  // A residual of constant parameters does not count in the cost.
  return blocks_.empty() && point_ == nullptr ? 0.0 : cost;
}

void BundleReducer::AddRows() {
  for (const JacobianBlock& a : blocks_) {
    const int first = matrix_.FirstColumnOf(a.block);
    const Eigen::VectorXd gradient = a.values.transpose() * residuals_;
    gradient_.segment(first, gradient.size()) += gradient;
    whole_gradient_.segment(first, gradient.size()) += gradient;
    diagonal_.segment(first, gradient.size()) +=
        a.values.colwise().squaredNorm();
    for (const JacobianBlock& b : blocks_) {
      if (b.block > a.block) continue;
      matrix_.Add(a.block, b.block,
                  a.values.transpose().lazyProduct(b.values).eval());
    }
  }
}

// Observations of one point follow each other.
void BundleReducer::AddPointRows() {
  if (point_ != last_point_) EliminateListedPoint();
  last_point_ = point_;
  point_information_.noalias() += by_point_.transpose().lazyProduct(by_point_);
  point_gradient_.noalias() += by_point_.transpose() * residuals_;
  for (const JacobianBlock& block : blocks_) {
    PointColumns* mixed = nullptr;
    for (auto& [seen, values] : mixed_) {
      if (seen == block.block) mixed = &values;
    }
    if (mixed == nullptr) {
      mixed_.emplace_back(block.block,
                          PointColumns::Zero(block.values.cols(), 3));
      mixed = &mixed_.back().second;
    }
    mixed->noalias() += block.values.transpose().lazyProduct(by_point_);
  }
}

void BundleReducer::EliminateListedPoint() {
  if (last_point_ == nullptr) return;
  const Eigen::Matrix3d covariance = point_information_.inverse();
  if (covariance.allFinite()) {
    for (const auto& [row, a] : mixed_) {
      const PointColumns weighted = a * covariance;
      gradient_.segment(matrix_.FirstColumnOf(row), a.rows()).noalias() -=
          weighted * point_gradient_;
      for (const auto& [col, b] : mixed_) {
        if (col > row) continue;
        matrix_.Add(row, col, (-weighted.lazyProduct(b.transpose())).eval());
      }
    }
  }
  point_information_.setZero();
  point_gradient_.setZero();
  mixed_.clear();
  last_point_ = nullptr;
}

ReducedPriorRows BundleReducer::PriorRows(
    const BundleProblem::PriorBlock& prior) const {
  ReducedPriorRows rows;
  rows.block = prior;
  rows.residuals = residuals_;
  for (const JacobianBlock& block : blocks_) {
    for (int col = 0; col < block.values.cols(); ++col) {
      rows.columns.push_back(matrix_.FirstColumnOf(block.block) + col);
    }
  }
  rows.jacobian.resize(residuals_.size(), rows.columns.size());
  int num_columns = 0;
  for (const JacobianBlock& block : blocks_) {
    rows.jacobian.middleCols(num_columns, block.values.cols()) = block.values;
    num_columns += block.values.cols();
  }
  return rows;
}

}  // namespace adasfm
