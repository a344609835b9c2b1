// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/rig_cost.h"

#include <algorithm>

namespace adasfm {
namespace {

using Jacobian = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;

}  // namespace

RigCost::RigCost(const ceres::CostFunction* inner, std::vector<RigPose> poses)
    : inner_(inner) {
  for (const RigPose& pose : poses) {
    Part part;
    part.pose = pose;
    if (pose.IsDerived()) {
      part.frame_block = IndexOf(pose.frame->parameters);
      part.cam_from_rig_block = IndexOf(pose.cam_from_rig->parameters);
    } else {
      part.frame_block = IndexOf(pose.pose->parameters);
    }
    parts_.push_back(part);
  }
  set_num_residuals(inner->num_residuals());
  auto* sizes = mutable_parameter_block_sizes();
  sizes->assign(blocks_.size(), 6);
  const auto& inner_sizes = inner->parameter_block_sizes();
  sizes->insert(sizes->end(), inner_sizes.begin() + parts_.size(),
                inner_sizes.end());
}

int RigCost::IndexOf(double* block) {
  const int index = static_cast<int>(
      std::find(blocks_.begin(), blocks_.end(), block) - blocks_.begin());
  if (index == static_cast<int>(blocks_.size())) blocks_.push_back(block);
  return index;
}

bool RigCost::Evaluate(double const* const* parameters, double* residuals,
                       double** jacobians) const {
  const size_t num_others = parameter_block_sizes().size() - blocks_.size();
  std::vector<const double*> inner_parameters;
  for (const Part& part : parts_) {
    inner_parameters.push_back(part.pose.pose->parameters);
  }
  for (size_t i = 0; i < num_others; ++i) {
    inner_parameters.push_back(parameters[blocks_.size() + i]);
  }
  if (jacobians == nullptr) {
    return inner_->Evaluate(inner_parameters.data(), residuals, nullptr);
  }
  std::vector<Jacobian> by_pose(parts_.size(), Jacobian(num_residuals(), 6));
  std::vector<double*> inner_jacobians;
  for (Jacobian& jacobian : by_pose) inner_jacobians.push_back(jacobian.data());
  for (size_t i = 0; i < num_others; ++i) {
    inner_jacobians.push_back(jacobians[blocks_.size() + i]);
  }
  if (!inner_->Evaluate(inner_parameters.data(), residuals,
                        inner_jacobians.data())) {
    return false;
  }
  for (size_t i = 0; i < blocks_.size(); ++i) {
    if (jacobians[i] == nullptr) continue;
    Eigen::Map<Jacobian>(jacobians[i], num_residuals(), 6).setZero();
  }
  for (size_t k = 0; k < parts_.size(); ++k) {
    const Part& part = parts_[k];
    const auto by_rotation = by_pose[k].leftCols<3>();
    const auto by_center = by_pose[k].rightCols<3>();
    if (double* values = jacobians[part.frame_block]) {
      Eigen::Map<Jacobian> jacobian(values, num_residuals(), 6);
      if (!part.pose.IsDerived()) {
        jacobian += by_pose[k];
      } else {
        const AdjustedPose& frame = *part.pose.frame;
        const AdjustedPose& cam_from_rig = *part.pose.cam_from_rig;
        jacobian.leftCols<3>() += (by_rotation * cam_from_rig.rotation +
                                   by_center * frame.rotation.transpose() *
                                       Hat(cam_from_rig.center)) *
                                  frame.left_jacobian;
        jacobian.rightCols<3>() += by_center;
      }
    }
    if (part.cam_from_rig_block < 0) continue;
    if (double* values = jacobians[part.cam_from_rig_block]) {
      Eigen::Map<Jacobian> jacobian(values, num_residuals(), 6);
      jacobian.leftCols<3>() +=
          by_rotation * part.pose.cam_from_rig->left_jacobian;
      jacobian.rightCols<3>() +=
          by_center * part.pose.frame->rotation.transpose();
    }
  }
  return true;
}

}  // namespace adasfm
