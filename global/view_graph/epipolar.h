// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// The first-order epipolar distance of a match, in px, for rays x1, x2 and
// x2 ~ R x1 + t. With the constraint e = x2 . (t x R x1) and its gradients
// n2 = t x R x1 (by x2) and n1 = R^T (x2 x t) (by x1), both taken to pixels by
// the rays' Jacobians: distance = e / sqrt(|J1^T n1|^2 + |J2^T n2|^2).
struct EpipolarResidual {
  double distance_px = 0.0;
  // 1 / the root above; 0 when it vanishes (then distance_px is 0 too).
  double inverse_norm = 0.0;
};

inline EpipolarResidual ComputeEpipolarResidual(
    const Bearing& bearing1, const Bearing& bearing2,
    const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  const Eigen::Vector3d x1_in_cam2 = rotation * bearing1.direction;
  const Eigen::Vector3d n2 = translation.cross(x1_in_cam2);
  const Eigen::Vector3d n1 =
      rotation.transpose() * bearing2.direction.cross(translation);
  const double norm =
      std::sqrt((bearing1.jacobian.transpose() * n1).squaredNorm() +
                (bearing2.jacobian.transpose() * n2).squaredNorm());
  EpipolarResidual residual;
  if (!(norm > 1e-15)) return residual;
  residual.inverse_norm = 1.0 / norm;
  residual.distance_px = bearing2.direction.dot(n2) / norm;
  return residual;
}

// A distance with its derivatives by a rotation vector in camera 2's frame
// (R -> Exp(w) R) and by t. Scaling t changes nothing, so the latter is
// orthogonal to t. Zero where the root vanishes.
struct EpipolarTerm {
  double distance_px = 0.0;
  Eigen::Matrix<double, 6, 1> jacobian = Eigen::Matrix<double, 6, 1>::Zero();
};

// The root N changes with the pose too. With y = R x1, m = x2 x t, and
// a = J J^T n of both images:
//   N d(distance) = de - (e / N^2) (a1 . dn1 + a2 . dn2)
//   de = x2 . dn2,   dn2 = t x (w x y) + dt x y,   dn1 = R^T (m x w + x2 x dt)
// Descent with de / N alone does not end at the least distances.
inline EpipolarTerm LinearizeEpipolarDistance(
    const Bearing& bearing1, const Bearing& bearing2,
    const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
  const Eigen::Vector3d& x2 = bearing2.direction;
  const Eigen::Vector3d y = rotation * bearing1.direction;
  const Eigen::Vector3d m = x2.cross(translation);
  const Eigen::Vector3d n2 = translation.cross(y);
  const Eigen::Vector2d root1 =
      bearing1.jacobian.transpose() * (rotation.transpose() * m);
  const Eigen::Vector2d root2 = bearing2.jacobian.transpose() * n2;
  const double squared_norm = root1.squaredNorm() + root2.squaredNorm();
  EpipolarTerm term;
  if (!(squared_norm > 1e-30)) return term;
  const double inverse_norm = 1.0 / std::sqrt(squared_norm);
  term.distance_px = inverse_norm * x2.dot(n2);
  const double factor = inverse_norm * term.distance_px;
  const Eigen::Vector3d a1 =
      factor * (rotation * (bearing1.jacobian * root1));  // in camera 2
  const Eigen::Vector3d a2 = factor * (bearing2.jacobian * root2);
  term.jacobian << y.cross(m - a2.cross(translation)) - a1.cross(m),
      y.cross(x2 - a2) - a1.cross(x2);
  term.jacobian *= inverse_norm;
  return term;
}

// Depths along both rays in units of |t|, of the point nearest to both:
// depth2 x2 = depth1 R x1 + t. False when the rays are parallel.
inline bool ComputeRayDepths(const Eigen::Vector3d& x1,
                             const Eigen::Vector3d& x2,
                             const Eigen::Matrix3d& rotation,
                             const Eigen::Vector3d& translation, double* depth1,
                             double* depth2, double* sin_parallax) {
  const Eigen::Vector3d x1_in_cam2 = rotation * x1;
  const Eigen::Vector3d normal = x2.cross(x1_in_cam2);
  const double squared_norm = normal.squaredNorm();
  if (!(squared_norm > 1e-20)) return false;
  *depth1 = -x2.cross(translation).dot(normal) / squared_norm;
  *depth2 = translation.cross(x1_in_cam2).dot(normal) / squared_norm;
  *sin_parallax = std::sqrt(squared_norm);
  return true;
}

// Two unit vectors orthogonal to a unit vector, as columns.
inline Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  Eigen::Index smallest;
  v.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = v.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  basis.col(1) = v.cross(basis.col(0));
  return basis;
}

// Whether points lie in front of both cameras rather than behind, by a vote
// weighted by parallax.
inline bool IsInFrontByVote(const std::vector<const Bearing*>& bearings1,
                            const std::vector<const Bearing*>& bearings2,
                            const std::vector<double>& weights,
                            const Eigen::Matrix3d& rotation,
                            const Eigen::Vector3d& translation) {
  double vote = 0.0;
  for (size_t k = 0; k < bearings1.size(); ++k) {
    const Eigen::Vector3d& x2 = bearings2[k]->direction;
    const Eigen::Vector3d x1_in_cam2 = rotation * bearings1[k]->direction;
    const Eigen::Vector3d normal = x2.cross(x1_in_cam2);
    const double norm = normal.norm();
    if (norm < 1e-12) continue;
    vote +=
        weights[k] *
        (translation.cross(x1_in_cam2) - x2.cross(translation)).dot(normal) /
        norm;
  }
  return vote >= 0.0;
}

// The bearings of an edge's matches, an even subset of at most max_num.
struct EdgeBearings {
  std::vector<const Bearing*> bearings1;
  std::vector<const Bearing*> bearings2;
};
inline EdgeBearings SelectEdgeBearings(const std::vector<Bearing>& bearings1,
                                       const std::vector<Bearing>& bearings2,
                                       const std::vector<FeatureMatch>& matches,
                                       int max_num) {
  EdgeBearings selected;
  const size_t count = std::min<size_t>(matches.size(), max_num);
  selected.bearings1.reserve(count);
  selected.bearings2.reserve(count);
  for (size_t k = 0; k < count; ++k) {
    const FeatureMatch& match = matches[k * matches.size() / count];
    selected.bearings1.push_back(&bearings1.at(match.point2D_idx1));
    selected.bearings2.push_back(&bearings2.at(match.point2D_idx2));
  }
  return selected;
}

}  // namespace adasfm
