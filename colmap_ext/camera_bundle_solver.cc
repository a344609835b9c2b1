// SPDX-License-Identifier: BSD-3-Clause
#include <base/camera_models.h>
#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "colmap_ext/bundle_solver.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

std::unique_ptr<ceres::CostFunction> CreateCost(const colmap::Camera& camera,
                                                const Eigen::Vector2d& xy,
                                                double sigma_px,
                                                const AdjustedPose* pose) {
  switch (camera.ModelId()) {
#define CAMERA_MODEL_CASE(Model)                         \
  case colmap::Model::kModelId:                          \
    return std::make_unique<ceres::AutoDiffCostFunction< \
        CameraReprojectionCost<colmap::Model>, 2, 6, 3,  \
        static_cast<int>(colmap::Model::kNumParams)>>(   \
        new CameraReprojectionCost<colmap::Model>(xy, sigma_px, pose));
    CAMERA_MODEL_CASES
#undef CAMERA_MODEL_CASE
  }
  return nullptr;
}

// The data as a Ceres problem, with intrinsics.
class CeresProblem final : private ceres::EvaluationCallback {
 public:
  CeresProblem(const PriorBundleAdjustmentOptions& options,
               const colmap::Reconstruction& reconstruction, BundleData* data)
      : options_(options),
        reconstruction_(reconstruction),
        data_(data),
        prior_loss_(options.prior_loss_scale) {
    if (options.reproj_loss_scale_px > 0.0) {
      reprojection_loss_ = std::make_unique<ceres::SoftLOneLoss>(
          options.reproj_loss_scale_px / options.keypoint_sigma_px);
    }
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.evaluation_callback = this;
    problem_ = std::make_unique<ceres::Problem>(problem_options);
    AddResiduals();
    SetConstantBlocks();
  }

  void Solve(PriorBundleAdjustmentSummary* summary) {
    ceres::Solver::Options solver;
    solver.max_num_iterations = options_.max_num_iterations;
    solver.function_tolerance = options_.function_tolerance;
    // The cost alone decides: gradients and steps have no common unit here.
    solver.gradient_tolerance = 1e-12;
    solver.parameter_tolerance = 1e-12;
    solver.logging_type = ceres::SILENT;
    // More threads would add in an order that changes from run to run.
    solver.num_threads = 1;
    solver.linear_solver_type = LinearSolver();
    solver.preconditioner_type = ceres::SCHUR_JACOBI;
    if (!data_->points.empty()) solver.linear_solver_ordering = Ordering();
    ceres::Solver::Summary result;
    ceres::Solve(solver, problem_.get(), &result);
    summary->num_iterations =
        result.num_successful_steps + result.num_unsuccessful_steps;
    summary->initial_cost = result.initial_cost;
    summary->final_cost = result.final_cost;
    summary->message = result.message;
    summary->success =
        result.IsSolutionUsable() && std::isfinite(result.final_cost);
    for (BundleData::Image& image : data_->images) image.pose.Update();
  }

  const std::map<camera_t, std::vector<double>>& Cameras() const {
    return cameras_;
  }

 private:
  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    if (!new_evaluation_point) return;
    for (BundleData::Image& image : data_->images) image.pose.Update();
  }

  void AddResiduals() {
    for (const BundleData::Observation& observation : data_->observations) {
      BundleData::Image& image = data_->images[observation.image];
      const camera_t camera_id = reconstruction_.Image(image.id).CameraId();
      const colmap::Camera& camera = reconstruction_.Camera(camera_id);
      std::vector<double>& params =
          cameras_.emplace(camera_id, camera.Params()).first->second;
      costs_.push_back(CreateCost(camera, observation.xy,
                                  options_.keypoint_sigma_px, &image.pose));
      problem_->AddResidualBlock(
          costs_.back().get(), reprojection_loss_.get(), image.pose.parameters,
          data_->points[observation.point].xyz.data(), params.data());
    }
    for (const BundleData::Prior& prior : data_->priors) {
      problem_->AddResidualBlock(prior.cost.get(),
                                 prior.is_gauge ? nullptr : &prior_loss_,
                                 data_->images[prior.image1].pose.parameters,
                                 data_->images[prior.image2].pose.parameters);
    }
  }

  void SetConstantBlocks() {
    for (BundleData::Image& image : data_->images) {
      if (image.is_constant && image.IsUsed()) {
        problem_->SetParameterBlockConstant(image.pose.parameters);
      }
    }
    for (auto& [camera_id, params] : cameras_) {
      const colmap::Camera& camera = reconstruction_.Camera(camera_id);
      std::vector<int> constant;
      const auto hold = [&](bool refine, const std::vector<size_t>& indices) {
        if (refine) return;
        constant.insert(constant.end(), indices.begin(), indices.end());
      };
      hold(options_.refine_focal_length, camera.FocalLengthIdxs());
      hold(options_.refine_principal_point, camera.PrincipalPointIdxs());
      hold(options_.refine_extra_params, camera.ExtraParamsIdxs());
      if (constant.size() == params.size()) {
        problem_->SetParameterBlockConstant(params.data());
      } else if (!constant.empty()) {
        problem_->SetManifold(
            params.data(), new ceres::SubsetManifold(params.size(), constant));
      }
    }
  }

  ceres::LinearSolverType LinearSolver() const {
    if (data_->points.empty()) return ceres::SPARSE_NORMAL_CHOLESKY;
    const int num_images = data_->NumFreeImages();
    if (num_images <= options_.max_num_images_dense) return ceres::DENSE_SCHUR;
    if (num_images <= options_.max_num_images_sparse) {
      return ceres::SPARSE_SCHUR;
    }
    return ceres::ITERATIVE_SCHUR;
  }

  // Points are eliminated first.
  std::shared_ptr<ceres::ParameterBlockOrdering> Ordering() {
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (BundleData::Point& point : data_->points) {
      ordering->AddElementToGroup(point.xyz.data(), 0);
    }
    for (BundleData::Image& image : data_->images) {
      if (image.IsUsed()) ordering->AddElementToGroup(image.pose.parameters, 1);
    }
    for (auto& [camera_id, params] : cameras_) {
      ordering->AddElementToGroup(params.data(), 1);
    }
    return ordering;
  }

  const PriorBundleAdjustmentOptions& options_;
  const colmap::Reconstruction& reconstruction_;
  BundleData* data_;
  std::map<camera_t, std::vector<double>> cameras_;
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
  std::unique_ptr<ceres::LossFunction> reprojection_loss_;
  ceres::CauchyLoss prior_loss_;
  std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace

void SolveBundleWithCameras(const PriorBundleAdjustmentOptions& options,
                            BundleData* data,
                            colmap::Reconstruction* reconstruction,
                            PriorBundleAdjustmentSummary* summary) {
  CeresProblem problem(options, *reconstruction, data);
  problem.Solve(summary);
  for (const auto& [camera_id, params] : problem.Cameras()) {
    const bool is_finite =
        std::all_of(params.begin(), params.end(),
                    [](double param) { return std::isfinite(param); });
    summary->success = summary->success && is_finite;
  }
  if (!summary->success) return;
  for (const auto& [camera_id, params] : problem.Cameras()) {
    reconstruction->Camera(camera_id).SetParams(params);
  }
}

}  // namespace adasfm
