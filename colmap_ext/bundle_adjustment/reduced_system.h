// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"

namespace adasfm {

// The rows of one term of a prior, in the adjustment's sigmas.
struct ReducedPriorRows {
  BundleProblem::PriorBlock block;
  Eigen::VectorXd residuals;
  // One column for each entry of `columns`.
  Eigen::MatrixXd jacobian;
  std::vector<int> columns;
};

// An adjustment, linearised at its values, without the points (Schur
// complement): a step x of poses, shared errors and intrinsics costs
//   x^T rest x / 2 + rest_gradient^T x
//   + sum over the rows r, J of priors of |r + J x|^2 / 2.
// Its columns are those of bundle_reducer.h.
struct ReducedSystem {
  // Keypoints, and everything else but the priors between two images: priors of
  // shared errors and rig extrinsics, positions. The lower triangle, with zeros
  // where the priors' rows would add.
  Eigen::SparseMatrix<double> rest;
  Eigen::VectorXd rest_gradient;
  std::vector<ReducedPriorRows> priors;
  // Column of the model's units per metre; -1 without an accelerometer.
  int unit_column = -1;
};

// The robust weights of all but the priors are applied; priors have none. unit:
// the parameter of unit_column.
std::unique_ptr<ReducedSystem> BuildReducedSystem(BundleProblem* bundle,
                                                  const double* unit = nullptr);

}  // namespace adasfm
