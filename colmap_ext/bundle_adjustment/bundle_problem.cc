// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_problem.h"

#include <ceres/normal_prior.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "colmap_ext/bundle_adjustment/prior_components.h"
#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {

BundleProblem::BundleProblem(const PriorBundleAdjustmentOptions& options,
                             const PriorBundleAdjustmentProblem& problem,
                             const colmap::Reconstruction& reconstruction,
                             bool may_keep_points_apart,
                             const Covisibility* covisibility)
    : options_(options),
      shared_errors_(options.shared_errors, problem.priors),
      prior_loss_(
          std::make_unique<ceres::CauchyLoss>(options.prior_loss_scale)) {
  if (options.reproj_loss_scale_px > 0.0) {
    reprojection_loss_ = std::make_unique<ceres::CauchyLoss>(
        options.reproj_loss_scale_px / options.keypoint_sigma_px);
  }
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  problem_options.evaluation_callback = this;
  problem_ = std::make_unique<ceres::Problem>(problem_options);
  AddImages(problem, reconstruction);
  points_apart_ = may_keep_points_apart && !options.RefinesCameras() &&
                  cams_from_rig_.empty();
  AddPoints(reconstruction, points_apart_ ? covisibility : nullptr);
  AddPriors(problem.priors);
  AddRigPriors(problem.rigs);
  shared_errors_.AddPriors(problem_.get());
  SetConstantBlocks(reconstruction);
}

void BundleProblem::PrepareForEvaluation(bool, bool new_evaluation_point) {
  if (!new_evaluation_point) return;
  UpdatePoses();
}

void BundleProblem::UpdatePoses() {
  for (auto& [camera_id, cam_from_rig] : cams_from_rig_) cam_from_rig.Update();
  for (auto& [image_id, block] : images_) {
    block.SolvedPose()->Update();
    if (block.IsDerived()) block.RigPose::Update();
  }
}

void BundleProblem::AddImages(const PriorBundleAdjustmentProblem& problem,
                              const colmap::Reconstruction& reconstruction) {
  const auto add = [&](image_t image_id, bool is_constant) {
    if (!reconstruction.ExistsImage(image_id)) return;
    const colmap::Image& image = reconstruction.Image(image_id);
    if (!IsRegistered(reconstruction, image_id)) return;
    ImageBlock& block = images_[image_id];
    block.is_constant = is_constant;
    CameraBlock& camera = cameras_[image.CameraId()];
    camera.params = ParamsOf(reconstruction.Camera(image.CameraId()));
    camera.is_constant = !options_.RefinesCameras() ||
                         problem.constant_cameras.count(image.CameraId()) > 0;
  };
  for (const image_t image_id : problem.images) add(image_id, false);
  for (const image_t image_id : problem.constant_images) add(image_id, true);
  poses_.reserve(2 * images_.size());  // As many frames at most.
  for (auto& [image_id, block] : images_) {
    poses_.emplace_back(CamFromWorld(reconstruction.Image(image_id)));
    block.pose = &poses_.back();
  }
  if (problem.constant_images.empty()) AddRigs(problem.rigs, reconstruction);
}

void BundleProblem::AddRigs(const CameraRigs& rigs,
                            const colmap::Reconstruction& reconstruction) {
  CameraRigs rigs_here = rigs;
  rigs_here.images.clear();
  for (const auto& [image_id, block] : images_) {
    const auto image = rigs.images.find(image_id);
    if (image != rigs.images.end()) rigs_here.images.insert(*image);
  }
  for (const auto& [frame_id, leader] : FindFrameLeaders(rigs_here)) {
    const RigCamera& camera = rigs.cameras.at(rigs.images.at(leader).camera_id);
    ImageBlock& block = images_.at(leader);
    if (!camera.is_reference) {
      poses_.emplace_back(camera.cam_from_rig->Inverse() *
                          CamFromWorld(reconstruction.Image(leader)));
    }
    block.frame = camera.is_reference ? block.pose : &poses_.back();
    for (const auto& [image_id, image] : rigs_here.images) {
      if (image.frame_id == frame_id) images_.at(image_id).frame = block.frame;
    }
  }
  for (const auto& [image_id, image] : rigs_here.images) {
    const RigCamera& camera = rigs.cameras.at(image.camera_id);
    ImageBlock& block = images_.at(image_id);
    if (camera.is_reference || !camera.cam_from_rig || !block.frame) continue;
    block.cam_from_rig =
        &cams_from_rig_.emplace(image.camera_id, *camera.cam_from_rig)
             .first->second;
  }
  UpdatePoses();
}

void BundleProblem::AddRigPriors(const CameraRigs& rigs) {
  for (auto& [camera_id, cam_from_rig] : cams_from_rig_) {
    if (!problem_->HasParameterBlock(cam_from_rig.parameters)) continue;
    const RigCamera& camera = rigs.cameras.at(camera_id);
    Eigen::Matrix<double, 6, 1> sigmas;
    sigmas << Eigen::Vector3d::Constant(camera.rotation_sigma_rad),
        Eigen::Vector3d::Constant(camera.translation_sigma_m);
    other_costs_.push_back(std::make_unique<ceres::NormalPrior>(
        Eigen::MatrixXd(sigmas.cwiseInverse().asDiagonal()),
        Eigen::VectorXd::Zero(6)));
    problem_->AddResidualBlock(other_costs_.back().get(), nullptr,
                               cam_from_rig.parameters);
  }
}

ceres::ResidualBlockId BundleProblem::AddCost(
    ceres::CostFunction* cost, ceres::LossFunction* loss,
    const std::vector<const ImageBlock*>& images,
    const std::vector<double*>& others) {
  std::vector<double*> parameters;
  bool is_derived = false;
  for (const ImageBlock* image : images) {
    parameters.push_back(image->pose->parameters);
    is_derived |= image->IsDerived();
  }
  if (is_derived) {
    std::vector<RigPose> poses;
    for (const ImageBlock* image : images) poses.push_back(*image);
    auto rig_cost = std::make_unique<RigCost>(cost, std::move(poses));
    parameters = rig_cost->Blocks();
    cost = rig_cost.get();
    other_costs_.push_back(std::move(rig_cost));
  }
  parameters.insert(parameters.end(), others.begin(), others.end());
  return problem_->AddResidualBlock(cost, loss, parameters);
}

void BundleProblem::AddPriors(const std::vector<PosePriorEdge>& edges) {
  using Term = PosePriorCost::Term;
  for (const PosePriorEdge& edge : edges) {
    const auto image1 = images_.find(edge.image_id1);
    const auto image2 = images_.find(edge.image_id2);
    if (image1 == images_.end() || image2 == images_.end() ||
        image1->second.SolvedPose() == image2->second.SolvedPose() ||
        (image1->second.is_constant && image2->second.is_constant)) {
      continue;
    }
    for (int k = 0; k < kNumPriorTerms; ++k) {
      const Term term = static_cast<Term>(k);
      const double sigma = edge.SigmaOf(term);
      if (!std::isfinite(sigma) || !(sigma > 0.0)) continue;
      prior_blocks_.push_back(
          {AddPrior(edge, term, &image1->second, &image2->second,
                    edge.is_held_by_points ? prior_loss_.get() : nullptr),
           term, edge.dt_s >= 0.0, edge.is_held_by_points,
           IsTestedMeasurement(edge, term)});
    }
  }
}

ceres::ResidualBlockId BundleProblem::AddPrior(const PosePriorEdge& edge,
                                               PosePriorCost::Term term,
                                               ImageBlock* image1,
                                               ImageBlock* image2,
                                               ceres::LossFunction* loss) {
  const double sigma_factor =
      edge.dt_s < 0.0 ? 1.0
                      : options_.prior_sigma_factors[static_cast<size_t>(term)];
  auto cost = std::make_unique<PosePriorCost>(edge, term, sigma_factor,
                                              image1->pose, image2->pose);
  const std::vector<double*> shared =
      shared_errors_.ParametersOf(edge, *cost, term);
  other_costs_.push_back(std::move(cost));
  image1->num_priors += 1;
  image2->num_priors += 1;
  return AddCost(other_costs_.back().get(), loss, {image1, image2}, shared);
}

void BundleProblem::SetConstantBlocks(
    const colmap::Reconstruction& reconstruction) {
  for (auto& [image_id, block] : images_) {
    if (!block.IsUsed()) continue;
    if (points_apart_) problem_->AddParameterBlock(block.pose->parameters, 6);
    if (block.is_constant) {
      problem_->SetParameterBlockConstant(block.pose->parameters);
    } else {
      num_adjusted_images_ += 1;
    }
  }
  for (auto& [camera_id, block] : cameras_) {
    if (!block.is_used) continue;
    const colmap::Camera& camera = reconstruction.Camera(camera_id);
    std::vector<int> constant;
    const auto hold = [&](bool refine, const auto& indices) {
      if (!refine)
        constant.insert(constant.end(), indices.begin(), indices.end());
    };
    hold(options_.refine_focal_length, camera.FocalLengthIdxs());
    hold(options_.refine_principal_point, camera.PrincipalPointIdxs());
    hold(options_.refine_extra_params, camera.ExtraParamsIdxs());
    if (constant.size() == block.params.size()) {
      problem_->SetParameterBlockConstant(block.params.data());
    } else if (!constant.empty()) {
      problem_->SetManifold(
          block.params.data(),
          new ceres::SubsetManifold(block.params.size(), constant));
    }
  }
}

bool BundleProblem::IsPoint(const double* parameters) const {
  if (points_.empty()) return false;
  const std::less<const void*> is_before;
  return !is_before(parameters, points_.data()) &&
         is_before(parameters, points_.data() + points_.size());
}

std::shared_ptr<ceres::ParameterBlockOrdering> BundleProblem::Ordering() {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (PointBlock& point : points_) {
    ordering->AddElementToGroup(point.xyz.data(), 0);
  }
  for (AdjustedPose& pose : poses_) {
    if (problem_->HasParameterBlock(pose.parameters)) {
      ordering->AddElementToGroup(pose.parameters, 1);
    }
  }
  for (auto& [camera_id, block] : cameras_) {
    if (block.is_used) ordering->AddElementToGroup(block.params.data(), 1);
  }
  // A group of its own: which of the arrays has the lower addresses differs
  // from run to run.
  for (double* values : shared_errors_.Used()) {
    ordering->AddElementToGroup(values, 2);
  }
  for (auto& [camera_id, cam_from_rig] : cams_from_rig_) {
    if (problem_->HasParameterBlock(cam_from_rig.parameters)) {
      ordering->AddElementToGroup(cam_from_rig.parameters, 3);
    }
  }
  for (std::vector<double>& values : other_parameters_) {
    ordering->AddElementToGroup(values.data(), 4);
  }
  return ordering;
}

bool BundleProblem::IsFinite() const {
  const auto all_finite = [](const double* values, size_t size) {
    return std::all_of(values, values + size,
                       [](double value) { return std::isfinite(value); });
  };
  for (const AdjustedPose& pose : poses_) {
    if (!all_finite(pose.parameters, 6)) return false;
  }
  for (const auto& [camera_id, cam_from_rig] : cams_from_rig_) {
    if (!all_finite(cam_from_rig.parameters, 6)) return false;
  }
  for (const PointBlock& point : points_) {
    if (!point.xyz.allFinite()) return false;
  }
  for (const auto& [camera_id, block] : cameras_) {
    if (!all_finite(block.params.data(), block.params.size())) return false;
  }
  return true;
}

void BundleProblem::WriteTo(colmap::Reconstruction* reconstruction) const {
  for (const auto& [image_id, block] : images_) {
    AdjustedPose pose = *block.SolvedPose();
    pose.Update();
    Rigid3d cam_from_world = pose.CamFromWorld();
    if (block.IsDerived()) {
      AdjustedPose cam_from_rig = *block.cam_from_rig;
      cam_from_rig.Update();
      cam_from_world = cam_from_rig.CamFromWorld() * cam_from_world;
    } else if (block.is_constant || !block.IsUsed()) {
      continue;
    }
    SetCamFromWorld(cam_from_world, &reconstruction->Image(image_id));
  }
  for (size_t k = 0; k < points_.size();) {
    const size_t begin = k;
    while (k < points_.size() && points_[k].id == points_[begin].id) ++k;
    SetXyz(PositionOf(begin, k), &reconstruction->Point3D(points_[begin].id));
  }
  for (const auto& [camera_id, block] : cameras_) {
    if (block.is_used) {
      ParamsOf(&reconstruction->Camera(camera_id)) = block.params;
    }
  }
}

}  // namespace adasfm
