// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/reduced_system.h"

#include <Eigen/LU>
#include <cstdint>
#include <unordered_map>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"

namespace adasfm {
namespace {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using PointColumns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
using Triplet = Eigen::Triplet<double>;

// A sum of blocks, of which the lower triangle is kept.
class BlockMatrix {
 public:
  explicit BlockMatrix(int size) : gradient_(Eigen::VectorXd::Zero(size)) {}

  // The block of these first row and column; zero at first.
  Eigen::MatrixXd& Block(int row, int col, int num_rows, int num_cols) {
    const uint64_t key = static_cast<uint64_t>(row) << 32 | col;
    const auto [block, is_new] = index_.emplace(key, blocks_.size());
    if (is_new) {
      blocks_.push_back({row, col, Eigen::MatrixXd::Zero(num_rows, num_cols)});
    }
    return blocks_[block->second].values;
  }
  Eigen::VectorXd& Gradient() { return gradient_; }

  void WriteTo(Eigen::SparseMatrix<double>* matrix) const {
    std::vector<Triplet> triplets;
    for (const Entry& block : blocks_) {
      for (int col = 0; col < block.values.cols(); ++col) {
        for (int row = 0; row < block.values.rows(); ++row) {
          if (block.row + row < block.col + col) continue;
          triplets.emplace_back(block.row + row, block.col + col,
                                block.values(row, col));
        }
      }
    }
    matrix->resize(gradient_.size(), gradient_.size());
    matrix->setFromTriplets(triplets.begin(), triplets.end());
  }

 private:
  struct Entry {
    int row = 0;
    int col = 0;
    Eigen::MatrixXd values;
  };
  Eigen::VectorXd gradient_;
  std::unordered_map<uint64_t, size_t> index_;
  std::vector<Entry> blocks_;
};

// One residual block's Jacobian by one parameter block.
struct JacobianBlock {
  int column = 0;
  RowMajorMatrix values;
};

class Reducer {
 public:
  explicit Reducer(BundleProblem* bundle)
      : bundle_(*bundle),
        problem_(*bundle->CeresProblem()),
        size_(NumberColumns()),
        rest_(size_) {}

  std::unique_ptr<ReducedSystem> Run() {
    auto system = std::make_unique<ReducedSystem>();
    const std::vector<BundleProblem::PriorBlock>& priors =
        bundle_.PriorBlocks();
    size_t num_priors = 0;
    bundle_.UpdatePoses();
    for (const ceres::ResidualBlockId id : ids_) {
      const bool is_prior =
          num_priors < priors.size() && priors[num_priors].residual == id;
      Evaluate(id, !is_prior);
      if (is_prior) {
        system->priors.push_back(PriorRows(priors[num_priors++]));
        continue;
      }
      AddRows();
      if (point_ != nullptr) AddPointRows();
    }
    EliminatePoint();
    rest_.WriteTo(&system->rest);
    system->rest_gradient = rest_.Gradient();
    return system;
  }

 private:
  // In order of the residuals; Ceres lists parameters by their addresses, which
  // are others in every run.
  int NumberColumns() {
    problem_.GetResidualBlocks(&ids_);
    std::vector<double*> blocks;
    int size = 0;
    for (const ceres::ResidualBlockId id : ids_) {
      problem_.GetParameterBlocksForResidualBlock(id, &blocks);
      for (double* block : blocks) {
        if (bundle_.IsPoint(block) ||
            problem_.IsParameterBlockConstant(block) ||
            !columns_.emplace(block, size).second) {
          continue;
        }
        size += problem_.ParameterBlockTangentSize(block);
      }
    }
    return size;
  }

  // Sets residuals_, blocks_ and, of keypoints, point_ and by_point_.
  void Evaluate(ceres::ResidualBlockId id, bool is_robust) {
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
      const auto column = columns_.find(parameters_[k]);
      if (column == columns_.end()) continue;
      blocks_.push_back(
          {column->second,
           RowMajorMatrix(num_rows,
                          problem_.ParameterBlockTangentSize(parameters_[k]))});
      pointers_[k] = blocks_.back().values.data();
    }
    problem_.EvaluateResidualBlockAssumingParametersUnchanged(
        id, is_robust, nullptr, residuals_.data(), pointers_.data());
  }

  void AddRows() {
    for (const JacobianBlock& a : blocks_) {
      rest_.Gradient().segment(a.column, a.values.cols()).noalias() +=
          a.values.transpose() * residuals_;
      for (const JacobianBlock& b : blocks_) {
        if (b.column > a.column) continue;
        BlockOf(a, b).noalias() += a.values.transpose().lazyProduct(b.values);
      }
    }
  }

  // In the pattern of the sum.
  void MakeRoomForRows() {
    for (const JacobianBlock& a : blocks_) {
      for (const JacobianBlock& b : blocks_) {
        if (b.column <= a.column) BlockOf(a, b);
      }
    }
  }

  Eigen::MatrixXd& BlockOf(const JacobianBlock& a, const JacobianBlock& b) {
    return rest_.Block(a.column, b.column, a.values.cols(), b.values.cols());
  }

  // Those of one point follow each other.
  void AddPointRows() {
    if (point_ != last_point_) EliminatePoint();
    last_point_ = point_;
    point_information_.noalias() +=
        by_point_.transpose().lazyProduct(by_point_);
    point_gradient_.noalias() += by_point_.transpose() * residuals_;
    for (const JacobianBlock& block : blocks_) {
      PointColumns* mixed = nullptr;
      for (auto& [column, values] : mixed_) {
        if (column == block.column) mixed = &values;
      }
      if (mixed == nullptr) {
        mixed_.emplace_back(block.column,
                            PointColumns::Zero(block.values.cols(), 3));
        mixed = &mixed_.back().second;
      }
      mixed->noalias() += block.values.transpose().lazyProduct(by_point_);
    }
  }

  void EliminatePoint() {
    if (last_point_ == nullptr) return;
    const Eigen::Matrix3d covariance = point_information_.inverse();
    if (covariance.allFinite()) {
      for (const auto& [row, a] : mixed_) {
        const PointColumns weighted = a * covariance;
        rest_.Gradient().segment(row, a.rows()).noalias() -=
            weighted * point_gradient_;
        for (const auto& [col, b] : mixed_) {
          if (col > row) continue;
          rest_.Block(row, col, a.rows(), b.rows()).noalias() -=
              weighted.lazyProduct(b.transpose());
        }
      }
    }
    point_information_.setZero();
    point_gradient_.setZero();
    mixed_.clear();
  }

  ReducedPriorRows PriorRows(const BundleProblem::PriorBlock& prior) {
    MakeRoomForRows();
    ReducedPriorRows rows;
    rows.prior = prior.prior;
    rows.term = prior.term;
    rows.residuals = residuals_;
    for (const JacobianBlock& block : blocks_) {
      for (int col = 0; col < block.values.cols(); ++col) {
        rows.columns.push_back(block.column + col);
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

  BundleProblem& bundle_;
  ceres::Problem& problem_;
  std::vector<ceres::ResidualBlockId> ids_;
  std::unordered_map<const double*, int> columns_;
  const int size_;
  BlockMatrix rest_;

  // Of the residual block at hand.
  std::vector<double*> parameters_;
  std::vector<double*> pointers_;
  Eigen::VectorXd residuals_;
  std::vector<JacobianBlock> blocks_;
  const double* point_ = nullptr;
  RowMajorMatrix by_point_;

  // Of the point at hand.
  const double* last_point_ = nullptr;
  Eigen::Matrix3d point_information_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_gradient_ = Eigen::Vector3d::Zero();
  std::vector<std::pair<int, PointColumns>> mixed_;
};

}  // namespace

std::unique_ptr<ReducedSystem> BuildReducedSystem(BundleProblem* bundle) {
  return Reducer(bundle).Run();
}

}  // namespace adasfm
