// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <unordered_map>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/block_matrix.h"
#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"
#include "colmap_ext/bundle_adjustment/settle_point.h"

namespace adasfm {

// The normal equations of an adjustment without its points (Schur complement),
// at the parameters as they are.
//
// Method: each point's derivatives are computed, eliminated and forgotten, once
// to build the equations and once more to move the point by their solution. No
// Jacobian is kept: an observation takes the 64 bytes of its keypoint, where
// Ceres takes 530 with its cost, its rows and its lists.
//
// Columns: the poses that are not constant and the other parameters, in an
// order of little fill (BlockMatrix::Reorder).
class BundleReducer {
 public:
  // The problem is complete, its gauge too. num_threads: of the points that it
  // keeps apart; any number adds in the same order.
  BundleReducer(BundleProblem* bundle, int num_threads);

  // Sets Matrix() and Gradient(); the cost, with the robust weights of all
  // residuals. Levenberg-Marquardt's damping of radius 1 / inverse_radius is
  // Ceres': by the diagonal, in units of the first call's. With `priors`, those
  // go there, without robust weights, and have only room in the matrix.
  double Linearize(double inverse_radius,
                   std::vector<ReducedPriorRows>* priors = nullptr);
  BlockMatrix& Matrix() { return matrix_; }
  // The parameters of its blocks.
  const std::vector<double*>& Parameters() const { return parameters_of_; }
  const Eigen::VectorXd& Gradient() const { return gradient_; }
  // Of all parameters, the points too.
  double LargestGradient() const { return largest_gradient_; }

  // What follows is for problems that keep their points apart.

  struct Step {
    // Of the cost, by the linearised residuals.
    double predicted_decrease = 0.0;
    // Of all parameters, and of the step.
    double squared_norm = 0.0;
    double squared_length = 0.0;
  };
  // Moves all parameters by the solution of the last equations.
  Step Move(const Eigen::VectorXd& step);
  void TakeBack();
  // Moves each point to its best place by the poses (settle_point.h). The cost.
  double SettlePoints(const SettlePointOptions& options);

 private:
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using PointColumns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  // One residual block's Jacobian by one parameter block.
  struct JacobianBlock {
    int block = 0;
    RowMajorMatrix values;
  };
  // The part of the normal equations that the observations of a point make.
  struct PointSums {
    struct Image {
      int block = 0;
      Eigen::Matrix<double, 6, 6> information;
      Eigen::Matrix<double, 6, 3> mixed;
      Eigen::Matrix<double, 6, 1> gradient;
    };
    // Those not constant.
    std::vector<Image> images;
    // Their places in ascending order of blocks, by SortImages.
    std::vector<int> order;
    Eigen::Matrix3d information;
    Eigen::Vector3d gradient;
    double cost = 0.0;
    // Of the damped information.
    Eigen::Matrix3d covariance;

    void SortImages();
  };
  // What the points at hand add to one column of blocks.
  struct PointColumn {
    int block = 0;
    // A point's place, and that of its image in the point's order.
    std::vector<std::pair<int, int>> images;
  };
  // What a part of the points adds up to.
  struct Totals {
    double cost = 0.0;
    double largest_gradient = 0.0;
    Step step;
  };

  int AddBlock(double* parameters, int size);
  void NumberBlocks();
  void FindPattern();
  void OrderBlocks();
  void AddPairsOfPoints();

  // Calls function(point, scratch, totals) for points kept apart, from `begin`,
  // where a part begins, to `end`; appends to the totals of the parts.
  template <typename Function>
  void ForEachPoint(size_t begin, size_t end, const Function& function,
                    std::vector<Totals>* parts) const;
  static Totals AddUp(const std::vector<Totals>& parts);
  Totals LinearizePoints();
  // Of the points from `begin` on.
  void LinearizePoints(size_t begin, std::vector<PointSums>* points,
                       std::vector<Totals>* parts);
  void Sum(size_t point, PointSums* sums) const;
  void Damp(size_t point, PointSums* sums) const;
  // Adds what is left of the points to the equations of the poses.
  void Eliminate(const std::vector<PointSums>& points);
  // Sets num_columns_ and the columns.
  void ListColumns(const std::vector<PointSums>& points);
  void AddToColumn(const std::vector<PointSums>& points,
                   const PointColumn& column);
  // By the step of the poses; adds to `total`.
  void MovePoint(const Eigen::VectorXd& step, size_t point,
                 const PointSums& sums, Step* total);
  void MoveOthers(const Eigen::VectorXd& step, Step* total);
  void DampPoses();

  // Sets residuals_, blocks_ and, of keypoints, point_ and by_point_; the cost.
  double Evaluate(ceres::ResidualBlockId id, bool is_robust);
  void AddRows();
  void AddPointRows();
  void EliminateListedPoint();
  ReducedPriorRows PriorRows(const BundleProblem::PriorBlock& prior) const;

  BundleProblem& bundle_;
  ceres::Problem& problem_;
  const int num_threads_;
  std::vector<ceres::ResidualBlockId> ids_;
  std::unordered_map<const double*, int> block_of_;
  std::vector<double*> parameters_of_;  // By block.
  std::vector<int> block_of_pose_;      // -1: constant.
  BlockMatrix matrix_;
  Eigen::VectorXd gradient_;
  // Before the elimination.
  Eigen::VectorXd whole_gradient_;
  Eigen::VectorXd diagonal_;
  double largest_gradient_ = 0.0;

  // Of the points at hand. The first num_columns_ are in use; by block, the
  // place of its column, or -1.
  std::vector<PointColumn> columns_;
  size_t num_columns_ = 0;
  std::vector<int> column_of_block_;

  // Of the damping.
  double inverse_radius_ = 0.0;
  Eigen::VectorXd scales_;
  std::vector<Eigen::Vector3d> point_scales_;
  // Before the last step.
  Eigen::VectorXd last_parameters_;
  std::vector<Eigen::Vector3d> last_points_;

  // Of the residual block at hand.
  std::vector<double*> parameters_;
  std::vector<double*> pointers_;
  Eigen::VectorXd residuals_;
  std::vector<JacobianBlock> blocks_;
  const double* point_ = nullptr;
  RowMajorMatrix by_point_;
  // Of the point at hand, when Ceres lists its observations.
  const double* last_point_ = nullptr;
  Eigen::Matrix3d point_information_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_gradient_ = Eigen::Vector3d::Zero();
  std::vector<std::pair<int, PointColumns>> mixed_;
};

// Levenberg-Marquardt's, as in Ceres: scales from the diagonal of the first
// linearisation, and what is added to a diagonal.
template <typename Vector>
Vector DampingScales(const Vector& diagonal) {
  return (1.0 + diagonal.array().sqrt()).inverse();
}

template <typename Vector>
Vector Damping(const Vector& diagonal, const Vector& scales,
               double inverse_radius) {
  constexpr double kMinDiagonal = 1e-6;
  constexpr double kMaxDiagonal = 1e32;
  return (diagonal.array() * scales.array().square())
             .max(kMinDiagonal)
             .min(kMaxDiagonal) *
         inverse_radius / scales.array().square();
}

}  // namespace adasfm
