// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace adasfm {

// The rotation R that minimises the Frobenius norm of R - matrix. For a sum of
// rotations, R is their chordal mean.
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

}  // namespace adasfm
