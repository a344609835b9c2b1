// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/pose_prior_cost.h"

#include <cmath>
#include <utility>

#include "core/so3.h"

namespace adasfm {
namespace {

// Translations shorter than this have no direction.
constexpr double kMinLength = 1e-12;
// Sine of the angle to the opposite direction below which an error has no
// direction either.
constexpr double kMinSineOpposite = 0.02;

Eigen::Matrix<double, 3, 2> OrthonormalComplement(const Eigen::Vector3d& unit) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = unit.unitOrthogonal();
  basis.col(1) = unit.cross(basis.col(0));
  return basis;
}

// Writes the 3-column Jacobians of both poses as Ceres wants them: row-major
// num_residuals x 6 (rotation, centre).
template <int kRows>
void WriteJacobian(const Eigen::Matrix<double, kRows, 3>& rotation,
                   const Eigen::Matrix<double, kRows, 3>& center,
                   double* target) {
  if (target == nullptr) return;
  for (int row = 0; row < kRows; ++row) {
    for (int col = 0; col < 3; ++col) {
      target[6 * row + col] = rotation(row, col);
      target[6 * row + 3 + col] = center(row, col);
    }
  }
}

// The Jacobians of a term that has this Jacobian by t.
template <int kRows>
void WriteTranslationJacobians(
    const Eigen::Matrix<double, kRows, 3>& from_translation,
    const Eigen::Vector3d& translation, const AdjustedPose& pose2,
    double** jacobians) {
  const Eigen::Matrix<double, kRows, 3> from_center =
      from_translation * pose2.rotation;
  WriteJacobian<kRows>(Eigen::Matrix<double, kRows, 3>::Zero(), from_center,
                       jacobians[0]);
  WriteJacobian<kRows>(
      -from_translation * Hat(translation) * pose2.left_jacobian, -from_center,
      jacobians[1]);
}

}  // namespace

Eigen::Vector2d DirectionError(const Eigen::Vector3d& vector,
                               const Eigen::Vector3d& unit_reference,
                               const Eigen::Matrix<double, 3, 2>& basis,
                               Eigen::Matrix<double, 2, 3>* jacobian) {
  if (jacobian != nullptr) jacobian->setZero();
  const double length = vector.norm();
  if (!(length > kMinLength)) return Eigen::Vector2d::Zero();
  const Eigen::Vector3d unit = vector / length;
  const Eigen::Vector2d in_plane = basis.transpose() * unit;
  const double sine = in_plane.norm();
  const double cosine = unit.dot(unit_reference);
  const double angle = std::atan2(sine, cosine);
  // Nearly opposite: rotations about all axes are equally long.
  if (cosine < 0.0 && sine < kMinSineOpposite) {
    return Eigen::Vector2d(kPi, 0.0);
  }
  const bool is_near = cosine > 0.0 && sine < 1e-4;
  // angle / sin(angle) and its change, by their series near zero.
  const double ratio = is_near ? 1.0 + sine * sine / 6.0 : angle / sine;
  if (jacobian != nullptr) {
    const double slope =
        is_near ? -2.0 / 3.0 : (cosine - ratio) / (sine * sine);
    const Eigen::Matrix<double, 2, 3> in_plane_from_unit = basis.transpose();
    const Eigen::Matrix<double, 2, 3> error_from_unit =
        ratio * in_plane_from_unit +
        in_plane * (slope * in_plane.transpose() * in_plane_from_unit -
                    unit_reference.transpose());
    *jacobian =
        (error_from_unit - error_from_unit * unit * unit.transpose()) / length;
  }
  return in_plane * ratio;
}

PosePriorCost::PosePriorCost(const PosePriorEdge& edge, Term term,
                             double sigma_factor, const AdjustedPose* pose1,
                             const AdjustedPose* pose2)
    : term_(term),
      pose1_(pose1),
      pose2_(pose2),
      rotation_(edge.cam2_from_cam1.rotation),
      translation_(edge.cam2_from_cam1.translation),
      length_(edge.cam2_from_cam1.translation.norm()) {
  if (length_ > kMinLength) {
    direction_ = edge.cam2_from_cam1.translation / length_;
  }
  basis_ = OrthonormalComplement(direction_);
  int num_residuals = 3;
  if (term == Term::kDirection) num_residuals = 2;
  if (term == Term::kLength) num_residuals = 1;
  inverse_sigma_ = 1.0 / (sigma_factor * edge.SigmaOf(term));
  set_num_residuals(num_residuals);
  if (edge.dt_s >= 0.0) {
    const Eigen::Matrix3d from_middle = CameraFromMiddle(rotation_);
    const Eigen::Matrix3d from_direction =
        -inverse_sigma_ * Hat(translation_) * from_middle;
    // Relative length error per unit of drift.
    const Eigen::RowVector3d length_ratio = edge.windows.length_per_direction *
                                            direction_.transpose() *
                                            from_middle;
    if (term == Term::kRotation) {
      from_shared_ = {inverse_sigma_ * (Eigen::Matrix3d::Identity() -
                                        rotation_.toRotationMatrix()),
                      inverse_sigma_ * edge.dt_s * from_middle};
      has_gyroscope_scale_ = true;
    } else if (term == Term::kTranslation) {
      from_shared_ = {
          from_direction,
          from_direction + inverse_sigma_ * translation_ * length_ratio};
    } else if (term == Term::kLength && edge.windows.length_per_direction > 0) {
      Eigen::Matrix3d along = Eigen::Matrix3d::Zero();
      along.row(0) = inverse_sigma_ * length_ * length_ratio;
      from_shared_ = {along};
    } else if (term == Term::kDirection && length_ > kMinLength) {
      Eigen::Matrix3d in_plane = Eigen::Matrix3d::Zero();
      in_plane.topRows<2>() = basis_.transpose() * from_direction / length_;
      from_shared_ = {in_plane, in_plane};
    }
  }
  *mutable_parameter_block_sizes() = {6, 6};
  mutable_parameter_block_sizes()->resize(
      2 + from_shared_.size() + (has_gyroscope_scale_ ? 1 : 0), 3);
  if (term == Term::kRotation) {
    if (edge.dt_s >= 0.0 && edge.windows.DependOnTimeShift()) {
      from_scalar_ = inverse_sigma_ * edge.windows.rotation_by_time_shift;
    }
  } else if (edge.windows.has_length_scale) {
    if (term == Term::kTranslation) {
      from_scalar_ = inverse_sigma_ * translation_;
    } else if (term == Term::kLength) {
      from_scalar_ = inverse_sigma_ * length_ * Eigen::Vector3d::UnitX();
    }
  }
  if (from_scalar_) mutable_parameter_block_sizes()->push_back(1);
}

bool PosePriorCost::Evaluate(double const* const* parameters, double* residuals,
                             double** jacobians) const {
  double* no_jacobians[6] = {};
  if (jacobians == nullptr) jacobians = no_jacobians;
  if (term_ == Term::kRotation) {
    EvaluateRotation(parameters, residuals, jacobians);
  } else {
    EvaluateTranslation(residuals, jacobians);
  }
  SubtractSharedErrors(parameters, residuals, jacobians);
  return true;
}

void PosePriorCost::SubtractSharedErrors(double const* const* parameters,
                                         double* residuals,
                                         double** jacobians) const {
  for (size_t k = 0; k < from_shared_.size(); ++k) {
    const Eigen::Map<const Eigen::Vector3d> shared(parameters[2 + k]);
    for (int row = 0; row < num_residuals(); ++row) {
      residuals[row] -= from_shared_[k].row(row).dot(shared);
      if (jacobians[2 + k] == nullptr) continue;
      for (int col = 0; col < 3; ++col) {
        jacobians[2 + k][3 * row + col] = -from_shared_[k](row, col);
      }
    }
  }
  if (!from_scalar_) return;
  const size_t last = parameter_block_sizes().size() - 1;
  for (int row = 0; row < num_residuals(); ++row) {
    residuals[row] -= (*from_scalar_)[row] * *parameters[last];
    if (jacobians[last] != nullptr) {
      jacobians[last][row] = -(*from_scalar_)[row];
    }
  }
}

void PosePriorCost::EvaluateRotation(double const* const* parameters,
                                     double* residuals,
                                     double** jacobians) const {
  const Eigen::Matrix3d cam2_from_cam1 =
      pose2_->rotation * pose1_->rotation.transpose();
  const Eigen::Vector3d error =
      LogSo3(Eigen::Quaterniond(cam2_from_cam1) * rotation_.conjugate());
  Eigen::Map<Eigen::Vector3d> residual(residuals);
  residual = inverse_sigma_ * error;
  // Exp(b) R Exp(-a) = Exp(b) Exp(-R a) R: the error moves by Jl^-1 (b - R a).
  Eigen::Matrix3d from_turn2 = inverse_sigma_ * RightJacobianInverseSo3(-error);
  if (has_gyroscope_scale_) {
    const size_t block = 2 + from_shared_.size();
    const Eigen::Vector3d scale(parameters[block]);
    const Eigen::Vector3d angles = LogSo3(Eigen::Quaterniond(cam2_from_cam1));
    residual -= inverse_sigma_ * scale.cwiseProduct(angles);
    from_turn2 -=
        inverse_sigma_ * scale.asDiagonal() * RightJacobianInverseSo3(-angles);
    if (jacobians[block] != nullptr) {
      Eigen::Map<Eigen::Matrix3d> by_scale(jacobians[block]);
      by_scale = Eigen::Matrix3d((-inverse_sigma_ * angles).asDiagonal());
    }
  }
  if (jacobians[0] == nullptr && jacobians[1] == nullptr) return;
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  WriteJacobian<3>(-from_turn2 * cam2_from_cam1 * pose1_->left_jacobian, zero,
                   jacobians[0]);
  WriteJacobian<3>(from_turn2 * pose2_->left_jacobian, zero, jacobians[1]);
}

// t = R_2 (C_1 - C_2): dt = -Hat(t) Jl dw_2 + R_2 (dc_1 - dc_2).
void PosePriorCost::EvaluateTranslation(double* residuals,
                                        double** jacobians) const {
  const Eigen::Vector3d translation =
      pose2_->rotation * (pose1_->center - pose2_->center);
  const bool needs_jacobian =
      jacobians[0] != nullptr || jacobians[1] != nullptr;
  if (term_ == Term::kLength) {
    const double length = translation.norm();
    residuals[0] = inverse_sigma_ * (length - length_);
    Eigen::Matrix<double, 1, 3> from_translation =
        Eigen::Matrix<double, 1, 3>::Zero();
    if (length > kMinLength) {
      from_translation = inverse_sigma_ * translation.transpose() / length;
    }
    // A rotation of camera 2 does not change the length.
    const Eigen::Matrix<double, 1, 3> zero =
        Eigen::Matrix<double, 1, 3>::Zero();
    const Eigen::Matrix<double, 1, 3> from_center =
        from_translation * pose2_->rotation;
    WriteJacobian<1>(zero, from_center, jacobians[0]);
    WriteJacobian<1>(zero, -from_center, jacobians[1]);
  } else if (term_ == Term::kDirection) {
    Eigen::Matrix<double, 2, 3> from_translation;
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    residual = inverse_sigma_ *
               DirectionError(translation, direction_, basis_,
                              needs_jacobian ? &from_translation : nullptr);
    if (!needs_jacobian) return;
    WriteTranslationJacobians<2>(inverse_sigma_ * from_translation, translation,
                                 *pose2_, jacobians);
  } else {
    Eigen::Map<Eigen::Vector3d> residual(residuals);
    residual = inverse_sigma_ * (translation - translation_);
    WriteTranslationJacobians<3>(inverse_sigma_ * Eigen::Matrix3d::Identity(),
                                 translation, *pose2_, jacobians);
  }
}

WeightedSumCost::WeightedSumCost(double sigma, std::vector<double> weights)
    : weights_(std::move(weights)) {
  for (double& weight : weights_) weight /= sigma;
  set_num_residuals(1);
  mutable_parameter_block_sizes()->assign(weights_.size(), 1);
}

bool WeightedSumCost::Evaluate(double const* const* parameters,
                               double* residuals, double** jacobians) const {
  *residuals = 0.0;
  for (size_t k = 0; k < weights_.size(); ++k) {
    *residuals += weights_[k] * *parameters[k];
    if (jacobians != nullptr && jacobians[k] != nullptr) {
      *jacobians[k] = weights_[k];
    }
  }
  return true;
}

bool DifferenceCost::Evaluate(double const* const* parameters,
                              double* residuals, double** jacobians) const {
  using Jacobian = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (int i = 0; i < 3; ++i) {
    residuals[i] =
        inverse_sigma_ * (parameters[1][i] - decay_ * parameters[0][i]);
  }
  for (int block = 0; jacobians != nullptr && block < 2; ++block) {
    if (jacobians[block] == nullptr) continue;
    Eigen::Map<Jacobian> jacobian(jacobians[block]);
    jacobian = Jacobian::Identity() *
               (block == 0 ? -decay_ * inverse_sigma_ : inverse_sigma_);
  }
  return true;
}

}  // namespace adasfm
