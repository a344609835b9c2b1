// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/reduced_camera_system.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace adasfm {
namespace {

// Bounds of the diagonal that the damping is taken from.
constexpr double kMinDiagonal = 1e-6;
constexpr double kMaxDiagonal = 1e32;
// Points are handled in batches of this many.
constexpr size_t kPointBatch = 256;

struct Loss {
  double cost = 0.0;    // rho / 2
  double weight = 1.0;  // rho'
};

// 2 a^2 (sqrt(1 + s / a^2) - 1), s the squared residual.
Loss SoftL1(double squared, double scale) {
  if (scale <= 0.0) return {0.5 * squared, 1.0};
  const double root = std::sqrt(1.0 + squared / (scale * scale));
  return {scale * scale * (root - 1.0), 1.0 / root};
}

// a^2 log(1 + s / a^2).
Loss Cauchy(double squared, double scale) {
  const double sum = 1.0 + squared / (scale * scale);
  return {0.5 * scale * scale * std::log(sum), 1.0 / sum};
}

Eigen::VectorXd Damping(const Eigen::VectorXd& diagonal, double radius) {
  return diagonal.cwiseMax(kMinDiagonal).cwiseMin(kMaxDiagonal) / radius;
}

}  // namespace

ReducedCameraSystem::ReducedCameraSystem(const BundleData& data,
                                         const BundleLosses& losses,
                                         int num_threads)
    : data_(data),
      losses_(losses),
      num_threads_(num_threads),
      row_of_image_(data.images.size(), -1),
      observations_of_image_(data.images.size()),
      terms_(data.observations.size()),
      prior_terms_(data.priors.size()),
      point_inverses_(data.points.size()),
      point_gradients_(data.points.size()),
      point_damping_(data.points.size()) {
  for (size_t i = 0; i < data.images.size(); ++i) {
    if (!data.images[i].IsFree()) continue;
    row_of_image_[i] = static_cast<int>(free_images_.size());
    free_images_.push_back(static_cast<int>(i));
  }
  first_observation_of_point_.assign(data.points.size() + 1, 0);
  for (size_t i = 0; i < data.observations.size(); ++i) {
    observations_of_image_[data.observations[i].image].push_back(
        static_cast<int>(i));
    first_observation_of_point_[data.observations[i].point + 1] =
        static_cast<int>(i) + 1;
  }
  pose_blocks_.resize(free_images_.size());
  pose_gradients_.resize(free_images_.size());
  pose_diagonals_.resize(free_images_.size());
  pose_damping_.resize(free_images_.size());
  right_side_.resize(free_images_.size());
  BuildStructure();
}

void ReducedCameraSystem::BuildStructure() {
  const int num_rows = static_cast<int>(free_images_.size());
  std::vector<std::vector<int>> prior_columns(num_rows);
  for (const BundleData::Prior& prior : data_.priors) {
    const int row1 = row_of_image_[prior.image1];
    const int row2 = row_of_image_[prior.image2];
    if (row1 < 0 || row2 < 0) continue;
    prior_columns[std::min(row1, row2)].push_back(std::max(row1, row2));
  }
  matrix_.columns.resize(num_rows);
  matrix_.blocks.resize(num_rows);
  ParallelFor(num_threads_, num_rows, [&](size_t row) {
    std::vector<int>& columns = matrix_.columns[row];
    columns = prior_columns[row];
    columns.push_back(static_cast<int>(row));
    std::vector<char> is_known(num_rows - row, false);
    for (const int own : observations_of_image_[free_images_[row]]) {
      const int point = data_.observations[own].point;
      for (int i = own + 1; i < first_observation_of_point_[point + 1]; ++i) {
        const int column = row_of_image_[data_.observations[i].image];
        if (column < 0 || is_known[column - row]) continue;
        is_known[column - row] = true;
        columns.push_back(column);
      }
    }
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
    matrix_.blocks[row].resize(columns.size());
  });
}

double ReducedCameraSystem::ComputeCost() const {
  std::vector<double> costs(data_.images.size(), 0.0);
  ParallelFor(num_threads_, data_.images.size(), [&](size_t image) {
    for (const int i : observations_of_image_[image]) {
      const BundleData::Observation& observation = data_.observations[i];
      const ReprojectionCost cost(observation.keypoint,
                                  &data_.images[image].pose);
      Eigen::Vector2d residual;
      cost.Evaluate(data_.points[observation.point].xyz, &residual, nullptr,
                    nullptr);
      costs[image] += SoftL1(residual.squaredNorm(), losses_.reprojection).cost;
    }
  });
  double sum = 0.0;
  for (const double cost : costs) sum += cost;
  for (const BundleData::Prior& prior : data_.priors) {
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    prior.cost->Evaluate(nullptr, residual.data(), nullptr);
    sum += prior.is_gauge ? 0.5 * residual.squaredNorm()
                          : Cauchy(residual.squaredNorm(), losses_.prior).cost;
  }
  return sum;
}

double ReducedCameraSystem::Linearize() {
  std::vector<double> costs(data_.images.size(), 0.0);
  ParallelFor(num_threads_, data_.images.size(), [&](size_t image) {
    costs[image] = LinearizeImage(static_cast<int>(image));
  });
  LinearizePriors();
  for (size_t row = 0; row < free_images_.size(); ++row) {
    pose_diagonals_[row] = pose_blocks_[row].diagonal();
  }
  for (size_t i = 0; i < data_.priors.size(); ++i) {
    const int row1 = row_of_image_[data_.priors[i].image1];
    const int row2 = row_of_image_[data_.priors[i].image2];
    if (row1 >= 0) {
      pose_gradients_[row1] += prior_terms_[i].gradient1;
      pose_diagonals_[row1] += prior_terms_[i].block11.diagonal();
    }
    if (row2 >= 0) {
      pose_gradients_[row2] += prior_terms_[i].gradient2;
      pose_diagonals_[row2] += prior_terms_[i].block22.diagonal();
    }
  }
  double sum = prior_cost_;
  for (const double cost : costs) sum += cost;
  return sum;
}

double ReducedCameraSystem::LinearizeImage(int image) {
  const AdjustedPose& pose = data_.images[image].pose;
  Matrix6d block = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double sum = 0.0;
  for (const int i : observations_of_image_[image]) {
    const BundleData::Observation& observation = data_.observations[i];
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 6> from_pose;
    Eigen::Matrix<double, 2, 3> from_point;
    ReprojectionCost(observation.keypoint, &pose)
        .Evaluate(data_.points[observation.point].xyz, &residual, &from_pose,
                  &from_point);
    const Loss loss = SoftL1(residual.squaredNorm(), losses_.reprojection);
    sum += loss.cost;
    const Eigen::Matrix<double, 2, 6> weighted_pose = loss.weight * from_pose;
    const Eigen::Matrix<double, 2, 3> weighted_point = loss.weight * from_point;
    block.noalias() += weighted_pose.transpose() * from_pose;
    gradient.noalias() += weighted_pose.transpose() * residual;
    ObservationTerms& terms = terms_[i];
    terms.pose_from_point.noalias() = weighted_pose.transpose() * from_point;
    terms.point.noalias() = weighted_point.transpose() * from_point;
    terms.gradient.noalias() = weighted_point.transpose() * residual;
  }
  const int row = row_of_image_[image];
  if (row >= 0) {
    pose_blocks_[row] = block;
    pose_gradients_[row] = gradient;
  }
  return sum;
}

void ReducedCameraSystem::LinearizePriors() {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
  prior_cost_ = 0.0;
  for (size_t i = 0; i < data_.priors.size(); ++i) {
    const BundleData::Prior& prior = data_.priors[i];
    Eigen::Vector3d residual = Eigen::Vector3d::Zero();
    double jacobian1[18], jacobian2[18];
    double* jacobians[] = {jacobian1, jacobian2};
    prior.cost->Evaluate(nullptr, residual.data(), jacobians);
    const int size = prior.cost->num_residuals();
    const Loss loss = prior.is_gauge
                          ? Loss{0.5 * residual.squaredNorm(), 1.0}
                          : Cauchy(residual.squaredNorm(), losses_.prior);
    prior_cost_ += loss.cost;
    const Eigen::Map<const RowMajor> from1(jacobian1, size, 6);
    const Eigen::Map<const RowMajor> from2(jacobian2, size, 6);
    PriorTerms& terms = prior_terms_[i];
    terms.block11 = loss.weight * from1.transpose() * from1;
    terms.block12 = loss.weight * from1.transpose() * from2;
    terms.block22 = loss.weight * from2.transpose() * from2;
    terms.gradient1 = loss.weight * from1.transpose() * residual.head(size);
    terms.gradient2 = loss.weight * from2.transpose() * residual.head(size);
  }
}

void ReducedCameraSystem::Reduce(double radius) {
  const size_t num_points = data_.points.size();
  const size_t num_batches = (num_points + kPointBatch - 1) / kPointBatch;
  ParallelFor(num_threads_, num_batches, [&](size_t batch) {
    const size_t end = std::min(num_points, (batch + 1) * kPointBatch);
    for (size_t point = batch * kPointBatch; point < end; ++point) {
      Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      for (int i = first_observation_of_point_[point];
           i < first_observation_of_point_[point + 1]; ++i) {
        block += terms_[i].point;
        gradient += terms_[i].gradient;
      }
      point_damping_[point] = Damping(block.diagonal(), radius);
      block.diagonal() += point_damping_[point];
      point_inverses_[point] = block.inverse();
      point_gradients_[point] = gradient;
    }
  });
  ParallelFor(num_threads_, free_images_.size(),
              [&](size_t row) { ReduceRow(static_cast<int>(row), radius); });
  AddPriors();
}

void ReducedCameraSystem::ReduceRow(int row, double radius) {
  const std::vector<int>& columns = matrix_.columns[row];
  std::vector<Matrix6d>& blocks = matrix_.blocks[row];
  std::vector<int> position(columns.back() - row + 1, -1);
  for (size_t k = 0; k < columns.size(); ++k) {
    position[columns[k] - row] = static_cast<int>(k);
    blocks[k].setZero();
  }
  pose_damping_[row] = Damping(pose_diagonals_[row], radius);
  blocks[0] = pose_blocks_[row];
  blocks[0].diagonal() += pose_damping_[row];
  Vector6d right_side = -pose_gradients_[row];
  for (const int own : observations_of_image_[free_images_[row]]) {
    const int point = data_.observations[own].point;
    const Matrix63d eliminated =
        terms_[own].pose_from_point * point_inverses_[point];
    right_side.noalias() += eliminated * point_gradients_[point];
    for (int i = own; i < first_observation_of_point_[point + 1]; ++i) {
      const int column = row_of_image_[data_.observations[i].image];
      if (column < 0) continue;
      blocks[position[column - row]].noalias() -=
          eliminated * terms_[i].pose_from_point.transpose();
    }
  }
  right_side_[row] = right_side;
}

Matrix6d& ReducedCameraSystem::Block(int row, int column) {
  const std::vector<int>& columns = matrix_.columns[row];
  return matrix_
      .blocks[row][std::lower_bound(columns.begin(), columns.end(), column) -
                   columns.begin()];
}

void ReducedCameraSystem::AddPriors() {
  for (size_t i = 0; i < data_.priors.size(); ++i) {
    const int row1 = row_of_image_[data_.priors[i].image1];
    const int row2 = row_of_image_[data_.priors[i].image2];
    const PriorTerms& terms = prior_terms_[i];
    if (row1 >= 0) Block(row1, row1) += terms.block11;
    if (row2 >= 0) Block(row2, row2) += terms.block22;
    if (row1 < 0 || row2 < 0) continue;
    if (row1 < row2) {
      Block(row1, row2) += terms.block12;
    } else {
      Block(row2, row1) += terms.block12.transpose();
    }
  }
}

std::vector<Eigen::Vector3d> ReducedCameraSystem::BackSubstitute(
    const std::vector<Vector6d>& pose_step, double* model_decrease) const {
  // With the damping D: decrease = (dx^T D dx - g^T dx) / 2 for the exact step.
  std::vector<Eigen::Vector3d> step(data_.points.size());
  double sum = 0.0;
  for (size_t point = 0; point < data_.points.size(); ++point) {
    Eigen::Vector3d gradient = point_gradients_[point];
    for (int i = first_observation_of_point_[point];
         i < first_observation_of_point_[point + 1]; ++i) {
      const int row = row_of_image_[data_.observations[i].image];
      if (row < 0) continue;
      gradient.noalias() +=
          terms_[i].pose_from_point.transpose() * pose_step[row];
    }
    step[point] = -point_inverses_[point] * gradient;
    sum += step[point].dot(point_damping_[point].cwiseProduct(step[point])) -
           point_gradients_[point].dot(step[point]);
  }
  for (size_t row = 0; row < pose_step.size(); ++row) {
    sum += pose_step[row].dot(pose_damping_[row].cwiseProduct(pose_step[row])) -
           pose_gradients_[row].dot(pose_step[row]);
  }
  *model_decrease = 0.5 * sum;
  return step;
}

}  // namespace adasfm
