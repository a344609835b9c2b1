// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_solver.h"

#include <chrono>
#include <cmath>

#include "colmap_ext/block_cholesky.h"
#include "colmap_ext/reduced_camera_system.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// Levenberg-Marquardt's trust region, as in Ceres.
constexpr double kInitialRadius = 1e4;
constexpr double kMaxRadius = 1e16;
constexpr double kMinRadius = 1e-16;
constexpr double kMinStepQuality = 1e-3;
// An inexact step is good enough when its residual has shrunk by this.
constexpr double kIterativeTolerance = 0.03;
constexpr int kMaxNumLinearIterations = 300;
// Problems with fewer residuals are solved faster by one thread.
constexpr int kMinNumResidualsForThreads = 2000;

// Solves the reduced system by factorisation or, for many images, iteration.
class LinearSolver {
 public:
  LinearSolver(const BlockMatrix& matrix, int max_num_images_direct) {
    if (matrix.NumRows() <= max_num_images_direct) {
      cholesky_ = std::make_unique<BlockCholesky>(matrix.columns);
    }
  }

  bool Solve(const BlockMatrix& matrix, const std::vector<Vector6d>& right_side,
             std::vector<Vector6d>* solution) {
    if (cholesky_ == nullptr) {
      return SolveIteratively(matrix, right_side, kIterativeTolerance,
                              kMaxNumLinearIterations, solution);
    }
    if (!cholesky_->Factorize(matrix)) return false;
    *solution = cholesky_->Solve(right_side);
    return true;
  }

 private:
  std::unique_ptr<BlockCholesky> cholesky_;
};

// The free poses' parameters and the points, to go back to.
struct State {
  std::vector<Vector6d> poses;
  std::vector<Eigen::Vector3d> points;
};

State GetState(const ReducedCameraSystem& system, const BundleData& data) {
  State state;
  for (const int image : system.FreeImages()) {
    state.poses.push_back(
        Eigen::Map<const Vector6d>(data.images[image].pose.parameters));
  }
  for (const BundleData::Point& point : data.points) {
    state.points.push_back(point.xyz);
  }
  return state;
}

void SetState(const ReducedCameraSystem& system, const State& state,
              BundleData* data) {
  for (size_t row = 0; row < state.poses.size(); ++row) {
    AdjustedPose& pose = data->images[system.FreeImages()[row]].pose;
    Eigen::Map<Vector6d>(pose.parameters) = state.poses[row];
    pose.Update();
  }
  for (size_t point = 0; point < state.points.size(); ++point) {
    data->points[point].xyz = state.points[point];
  }
}

State Add(const State& state, const std::vector<Vector6d>& pose_step,
          const std::vector<Eigen::Vector3d>& point_step) {
  State result = state;
  for (size_t i = 0; i < pose_step.size(); ++i) result.poses[i] += pose_step[i];
  for (size_t i = 0; i < point_step.size(); ++i) {
    result.points[i] += point_step[i];
  }
  return result;
}

}  // namespace

void SolveBundle(const PriorBundleAdjustmentOptions& options, BundleData* data,
                 PriorBundleAdjustmentSummary* summary) {
  BundleLosses losses;
  losses.reprojection =
      options.reproj_loss_scale_px / options.keypoint_sigma_px;
  losses.prior = options.prior_loss_scale;
  const int num_threads = data->NumResiduals() < kMinNumResidualsForThreads
                              ? 1
                              : options.num_threads;
  ReducedCameraSystem system(*data, losses, num_threads);
  LinearSolver solver(system.Matrix(), options.max_num_images_sparse);

  double cost = system.Linearize();
  summary->initial_cost = summary->final_cost = cost;
  summary->message = "the number of iterations was reached";
  if (!std::isfinite(cost)) {
    summary->message = "the cost at the start is not finite";
    return;
  }
  State state = GetState(system, *data);
  double radius = kInitialRadius;
  double radius_divisor = 2.0;
  for (int iteration = 0; iteration < options.max_num_iterations; ++iteration) {
    summary->num_iterations += 1;
    system.Reduce(radius);
    std::vector<Vector6d> pose_step;
    double new_cost = cost;
    double quality = -1.0;
    if (solver.Solve(system.Matrix(), system.RightSide(), &pose_step)) {
      double model_decrease = 0.0;
      const std::vector<Eigen::Vector3d> point_step =
          system.BackSubstitute(pose_step, &model_decrease);
      SetState(system, Add(state, pose_step, point_step), data);
      new_cost = system.ComputeCost();
      if (model_decrease <= options.function_tolerance * cost &&
          !(new_cost < cost)) {
        SetState(system, state, data);
        summary->message = "converged";
        break;
      }
      if (std::isfinite(new_cost) && data->IsFinite()) {
        quality = (cost - new_cost) / model_decrease;
      }
    }
    if (quality > kMinStepQuality) {
      const double change = cost - new_cost;
      state = GetState(system, *data);
      radius = std::min(
          kMaxRadius,
          radius / std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * quality - 1.0, 3)));
      radius_divisor = 2.0;
      const double old_cost = cost;
      cost = new_cost;
      if (change <= options.function_tolerance * old_cost) {
        summary->message = "converged";
        break;
      }
      system.Linearize();
    } else {
      SetState(system, state, data);
      radius /= radius_divisor;
      radius_divisor *= 2.0;
      if (radius < kMinRadius) {
        summary->message = "no step makes the cost smaller";
        break;
      }
    }
  }
  summary->final_cost = cost;
  summary->success = true;
}

}  // namespace adasfm
