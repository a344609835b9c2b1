// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/position_priors.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "core/median.h"

namespace adasfm {
namespace {

// Positions beyond so many loss scales are left out.
constexpr double kMaxDistance = 2.0;

using PoseJacobian = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;

bool TakesPart(const PositionPrior& prior, const BundleProblem& bundle) {
  return bundle.UsedPose(prior.image_id1) != nullptr &&
         bundle.UsedPose(prior.image_id2) != nullptr &&
         !(bundle.IsConstant(prior.image_id1) &&
           bundle.IsConstant(prior.image_id2));
}

void AddVerticals(const PriorBundleAdjustmentProblem& problem,
                  BundleProblem* bundle) {
  if (!std::isfinite(problem.gravity_sigma_rad)) return;
  std::vector<image_t> images;
  for (const auto& [image_id, gravity_in_cam] : problem.gravity_in_cam) {
    if (bundle->UsedPose(image_id) != nullptr &&
        !bundle->IsConstant(image_id)) {
      images.push_back(image_id);
    }
  }
  const double sigma_rad =
      problem.gravity_sigma_rad * std::sqrt(static_cast<double>(images.size()));
  for (const image_t image_id : images) {
    bundle->AddResidual(
        std::make_unique<VerticalCost>(problem.gravity_in_cam.at(image_id),
                                       sigma_rad, bundle->UsedPose(image_id)),
        nullptr, {image_id});
  }
}

}  // namespace

PositionCost::PositionCost(const PositionPrior& prior,
                           const AdjustedPose* pose1, const AdjustedPose* pose2)
    : prior_(prior),
      pose1_(pose1),
      pose2_(pose2),
      sqrt_information_(
          Eigen::LLT<Eigen::Matrix3d>(prior.covariance.inverse()).matrixU()) {
  set_num_residuals(3);
  mutable_parameter_block_sizes()->assign(pose1 == pose2 ? 1 : 2, 6);
}

bool PositionCost::Evaluate(double const* const* /*parameters*/,
                            double* residuals, double** jacobians) const {
  const bool is_of_one = pose1_ == pose2_;
  const AdjustedPose* poses[] = {pose1_, pose2_};
  const double shares[] = {is_of_one ? 1.0 : 1.0 - prior_.share, prior_.share};
  Eigen::Vector3d error = prior_.position;
  for (int k = 0; k < (is_of_one ? 1 : 2); ++k) {
    const AdjustedPose& pose = *poses[k];
    error -= shares[k] *
             (pose.center + pose.rotation.transpose() * prior_.antenna_in_cam);
    if (jacobians == nullptr || jacobians[k] == nullptr) continue;
    Eigen::Map<PoseJacobian> jacobian(jacobians[k]);
    jacobian.leftCols<3>() = -shares[k] * sqrt_information_ *
                             RotatedBackJacobian(pose, prior_.antenna_in_cam);
    jacobian.rightCols<3>() = -shares[k] * sqrt_information_;
  }
  Eigen::Map<Eigen::Vector3d> whitened(residuals);
  whitened = sqrt_information_ * error;
  return true;
}

VerticalCost::VerticalCost(const Eigen::Vector3d& gravity_in_cam,
                           double sigma_rad, const AdjustedPose* pose)
    : gravity_in_cam_(gravity_in_cam),
      inverse_sigma_(1.0 / sigma_rad),
      pose_(pose) {
  set_num_residuals(3);
  mutable_parameter_block_sizes()->assign(1, 6);
}

bool VerticalCost::Evaluate(double const* const* /*parameters*/,
                            double* residuals, double** jacobians) const {
  Eigen::Map<Eigen::Vector3d> whitened(residuals);
  whitened = inverse_sigma_ * (pose_->rotation.transpose() * gravity_in_cam_ +
                               Eigen::Vector3d::UnitZ());
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Map<PoseJacobian> jacobian(jacobians[0]);
  jacobian.leftCols<3>() =
      inverse_sigma_ * RotatedBackJacobian(*pose_, gravity_in_cam_);
  jacobian.rightCols<3>().setZero();
  return true;
}

namespace {

// The whitened distance of a position from its prediction by the poses.
double WhitenedDistance(const PositionPrior& prior,
                        const BundleProblem& bundle) {
  const AdjustedPose* pose1 = bundle.UsedPose(prior.image_id1);
  const AdjustedPose* pose2 = bundle.UsedPose(prior.image_id2);
  const double* parameters[] = {pose1->parameters, pose2->parameters};
  Eigen::Vector3d residuals;
  PositionCost(prior, pose1, pose2)
      .Evaluate(parameters, residuals.data(), nullptr);
  return residuals.norm();
}

// The positions that take part and are at most kMaxDistance loss scales off.
// The limit grows with the median distance where that exceeds its value for
// normal errors. Positions thus correct a deformed model, while single jumps in
// a model that fits have no effect.
std::vector<PositionPrior> SelectPositions(
    double loss_scale, const std::vector<PositionPrior>& positions,
    const BundleProblem& bundle) {
  std::vector<PositionPrior> selected;
  std::vector<double> distances;
  for (const PositionPrior& prior : positions) {
    if (!TakesPart(prior, bundle)) continue;
    selected.push_back(prior);
    distances.push_back(WhitenedDistance(prior, bundle));
  }
  const double factor = std::max(1.0, Median(distances) / kMedianNorm3);
  const double max_distance = kMaxDistance * loss_scale * factor;
  std::vector<PositionPrior> near;
  for (size_t i = 0; i < selected.size(); ++i) {
    if (distances[i] <= max_distance) near.push_back(selected[i]);
  }
  return near;
}

}  // namespace

int AddPositionPriors(double loss_scale,
                      const PriorBundleAdjustmentProblem& problem,
                      BundleProblem* bundle) {
  const std::vector<PositionPrior> positions =
      SelectPositions(loss_scale, problem.positions, *bundle);
  const int num_positions = static_cast<int>(positions.size());
  if (num_positions < kMinNumPositionsForGauge) return num_positions;
  for (const PositionPrior& prior : positions) {
    std::vector<image_t> images = {prior.image_id1};
    if (prior.image_id2 != prior.image_id1) images.push_back(prior.image_id2);
    bundle->AddResidual(
        std::make_unique<PositionCost>(prior, bundle->UsedPose(prior.image_id1),
                                       bundle->UsedPose(prior.image_id2)),
        std::make_unique<ceres::CauchyLoss>(loss_scale), images);
  }
  AddVerticals(problem, bundle);
  return num_positions;
}

const AdjustedPose* BundleProblem::UsedPose(image_t image_id) const {
  const auto block = images_.find(image_id);
  return block == images_.end() || !block->second.IsUsed() ? nullptr
                                                           : block->second.pose;
}

bool BundleProblem::IsConstant(image_t image_id) const {
  return images_.at(image_id).is_constant;
}

double* BundleProblem::AddParameters(std::vector<double> values) {
  other_parameters_.push_back(std::move(values));
  return other_parameters_.back().data();
}

ceres::ResidualBlockId BundleProblem::AddResidual(
    std::unique_ptr<ceres::CostFunction> cost,
    std::unique_ptr<ceres::LossFunction> loss,
    const std::vector<image_t>& image_ids,
    const std::vector<double*>& parameters) {
  std::vector<const ImageBlock*> images;
  for (const image_t image_id : image_ids) {
    images.push_back(&images_.at(image_id));
  }
  other_costs_.push_back(std::move(cost));
  other_losses_.push_back(std::move(loss));
  return AddCost(other_costs_.back().get(), other_losses_.back().get(), images,
                 parameters);
}

}  // namespace adasfm
