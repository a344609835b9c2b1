// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/ceres.h>

#include <Eigen/Core>
#include <unordered_map>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/bundle_adjustment/minimize_point.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"
#include "core/sparse/block_matrix.h"

namespace adasfm {

// The normal equations of an adjustment without its points (Schur complement),
// at the present parameters.
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
  // The problem must be complete, including its gauge. num_threads is for the
  // points kept apart; the order of additions does not depend on it.
  BundleReducer(BundleProblem* bundle, int num_threads);

  // Sets Matrix() and Gradient(); returns the cost, with the robust weights of
  // all residuals. Damping is that of Ceres' Levenberg-Marquardt with radius
  // 1 / inverse_radius: by the diagonal, in units of the first call's. With
  // `priors`, the rows of the priors go there, without robust weights, and the
  // matrix only has room for them.
  double Linearize(double inverse_radius,
                   std::vector<ReducedPriorRows>* priors = nullptr);
  BlockMatrix& Matrix() { return matrix_; }
  // The parameters of the matrix's blocks.
  const std::vector<double*>& Parameters() const { return parameters_of_; }
  const Eigen::VectorXd& Gradient() const { return gradient_; }
  // Over all parameters, including the points.
  double LargestGradient() const { return largest_gradient_; }

  // The functions below are for problems that keep their points apart.

  struct Step {
    // Decrease of the cost by the linearised residuals.
    double predicted_decrease = 0.0;
    // Squared norms of all parameters and of the step.
    double squared_norm = 0.0;
    double squared_length = 0.0;
  };
  // Moves all parameters by the solution of the last equations, points by
  // inverse distances or as Ceres does.
  Step Move(const Eigen::VectorXd& step, bool by_inverse_distance);
  void TakeBack();
  // Moves each point to its optimum at the present poses (minimize_point.h).
  // Returns the cost.
  double MinimizePoints(const MinimizePointOptions& options);

 private:
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using PointColumns = Eigen::Matrix<double, Eigen::Dynamic, 3>;
  // One residual block's Jacobian by one parameter block.
  struct JacobianBlock {
    int block = 0;
    RowMajorMatrix values;
  };
  // The contribution of a point's observations to the normal equations.
  struct PointSums {
    struct Image {
      int block = 0;
      Eigen::Matrix<double, 6, 6> information;
      Eigen::Matrix<double, 6, 3> mixed;
      Eigen::Matrix<double, 6, 1> gradient;
    };
    // The images that are not constant.
    std::vector<Image> images;
    // Indices of `images` in ascending order of blocks, set by SortImages.
    std::vector<int> order;
    Eigen::Matrix3d information;
    Eigen::Vector3d gradient;
    double cost = 0.0;
    // Inverse of the damped information.
    Eigen::Matrix3d covariance;

    void SortImages();
  };
  // The contributions of the current points to one column of blocks.
  struct PointColumn {
    int block = 0;
    // Index of a point, and of its image in the point's order.
    std::vector<std::pair<int, int>> images;
  };
  // Sums over a part of the points.
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
  // the first of a part, to `end`; appends to the totals of the parts.
  template <typename Function>
  void ForEachPoint(size_t begin, size_t end, const Function& function,
                    std::vector<Totals>* parts) const;
  static Totals AddUp(const std::vector<Totals>& parts);
  Totals LinearizePoints();
  // Linearises the points from `begin` on.
  void LinearizePoints(size_t begin, std::vector<PointSums>* points,
                       std::vector<Totals>* parts);
  void Sum(size_t point, PointSums* sums) const;
  void Damp(size_t point, PointSums* sums) const;
  // Adds the points, eliminated, to the equations of the poses.
  void Eliminate(const std::vector<PointSums>& points);
  // Sets num_columns_ and the columns.
  void ListColumns(const std::vector<PointSums>& points);
  void AddToColumn(const std::vector<PointSums>& points,
                   const PointColumn& column);
  // Moves a point according to the step of the poses; adds to `total`.
  void MovePoint(const Eigen::VectorXd& step, bool by_inverse_distance,
                 size_t point, const PointSums& sums, Step* total);
  void MoveOthers(const Eigen::VectorXd& step, Step* total);
  void DampPoses();

  // Sets residuals_, blocks_ and, for keypoints, point_ and by_point_. Returns
  // the cost.
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
  // Gradient and diagonal before the elimination of points.
  Eigen::VectorXd whole_gradient_;
  Eigen::VectorXd diagonal_;
  double largest_gradient_ = 0.0;

  // The columns of the current points, the first num_columns_ in use.
  // column_of_block_: by block, the index of its column, or -1.
  std::vector<PointColumn> columns_;
  size_t num_columns_ = 0;
  std::vector<int> column_of_block_;

  // State of the damping.
  double inverse_radius_ = 0.0;
  Eigen::VectorXd scales_;
  std::vector<Eigen::Vector3d> point_scales_;
  // Values before the last step.
  Eigen::VectorXd last_parameters_;
  std::vector<Eigen::Vector3d> last_points_;

  // Of the current residual block.
  std::vector<double*> parameters_;
  std::vector<double*> pointers_;
  Eigen::VectorXd residuals_;
  std::vector<JacobianBlock> blocks_;
  const double* point_ = nullptr;
  RowMajorMatrix by_point_;
  // Of the current point, where the Ceres problem has its observations.
  const double* last_point_ = nullptr;
  Eigen::Matrix3d point_information_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d point_gradient_ = Eigen::Vector3d::Zero();
  std::vector<std::pair<int, PointColumns>> mixed_;
};

}  // namespace adasfm
