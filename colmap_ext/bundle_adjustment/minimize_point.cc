// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/minimize_point.h"

#include <Eigen/LU>

namespace adasfm {
namespace {

// The normal equations of a point alone.
struct PointEquations {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0.0;
};

PointEquations Linearize(const BundleProblem::ObservationRange& observations,
                         const ceres::LossFunction* loss,
                         const Eigen::Vector3d& point) {
  PointEquations equations;
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  for (const PointObservation& observation : observations) {
    observation.Evaluate(point, residual.data(), nullptr, by_point.data());
    double rho[3] = {residual.squaredNorm(), 1.0, 0.0};
    if (loss != nullptr) loss->Evaluate(rho[0], rho);
    equations.cost += 0.5 * rho[0];
    equations.gradient.noalias() += rho[1] * by_point.transpose() * residual;
    equations.information.noalias() += rho[1] * by_point.transpose() * by_point;
  }
  return equations;
}

}  // namespace

double MinimizePoint(const MinimizePointOptions& options,
                     const BundleProblem::ObservationRange& observations,
                     const ceres::LossFunction* loss, Eigen::Vector3d* point) {
  PointEquations equations = Linearize(observations, loss, *point);
  const Eigen::Vector3d center = observations.begin()->pose->center;
  for (int i = 0; i < options.max_num_iterations; ++i) {
    const Eigen::Vector3d step =
        -equations.information.inverse() * equations.gradient;
    const double predicted_decrease = -0.5 * equations.gradient.dot(step);
    // Not a number where the information has no inverse.
    if (!(predicted_decrease > options.function_tolerance * equations.cost)) {
      break;
    }
    const Eigen::Vector3d moved =
        center + MoveByInverseDistance(*point - center, step);
    const PointEquations next = Linearize(observations, loss, moved);
    if (!(next.cost < equations.cost)) break;
    *point = moved;
    equations = next;
  }
  return equations.cost;
}

}  // namespace adasfm
