// SPDX-License-Identifier: BSD-3-Clause
// The part of BundleReducer on points that the problem keeps apart.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "colmap_ext/bundle_adjustment/bundle_reducer.h"
#include "core/parallel.h"

namespace adasfm {

template <typename Function>
BundleReducer::Totals BundleReducer::ForEachPoint(
    const Function& function) const {
  constexpr size_t kNumPointsAtOnce = 256;
  const size_t num_points = bundle_.NumPointsApart();
  std::vector<Totals> parts((num_points + kNumPointsAtOnce - 1) /
                            kNumPointsAtOnce);
  ParallelFor(num_threads_, parts.size(), [&](size_t k) {
    PointSums sums;
    const size_t end = std::min(num_points, (k + 1) * kNumPointsAtOnce);
    for (size_t point = k * kNumPointsAtOnce; point < end; ++point) {
      function(point, &sums, &parts[k]);
    }
  });
  Totals all;
  for (const Totals& part : parts) {
    all.cost += part.cost;
    all.largest_gradient =
        std::max(all.largest_gradient, part.largest_gradient);
    all.step.predicted_decrease += part.step.predicted_decrease;
    all.step.squared_norm += part.step.squared_norm;
    all.step.squared_length += part.step.squared_length;
  }
  return all;
}

BundleReducer::Totals BundleReducer::LinearizePoints() {
  const bool is_first = point_scales_.empty();
  if (is_first) point_scales_.resize(bundle_.NumPointsApart());
  return ForEachPoint([&](size_t point, PointSums* sums, Totals* part) {
    Sum(point, sums);
    if (is_first) {
      point_scales_[point] =
          DampingScales<Eigen::Vector3d>(sums->information.diagonal());
    }
    Damp(point, sums);
    EliminatePoint(*sums);
    part->cost += sums->cost;
    part->largest_gradient = std::max(part->largest_gradient,
                                      sums->gradient.lpNorm<Eigen::Infinity>());
  });
}

void BundleReducer::Sum(size_t point, PointSums* sums) const {
  sums->images.clear();
  sums->information.setZero();
  sums->gradient.setZero();
  sums->cost = 0.0;
  const ceres::LossFunction* loss = bundle_.ReprojectionLoss();
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  for (const PointObservation& observation : bundle_.ObservationsOf(point)) {
    observation.Evaluate(bundle_.PointApart(point), residual.data(),
                         by_pose.data(), by_point.data());
    double rho[3] = {residual.squaredNorm(), 1.0, 0.0};
    if (loss != nullptr) {
      loss->Evaluate(rho[0], rho);
      const double weight = std::sqrt(rho[1]);
      residual *= weight;
      by_pose *= weight;
      by_point *= weight;
    }
    sums->cost += 0.5 * rho[0];
    sums->information.noalias() += by_point.transpose() * by_point;
    sums->gradient.noalias() += by_point.transpose() * residual;
    const int block = block_of_pose_[observation.pose - bundle_.Poses().data()];
    if (block < 0) continue;
    // Twice in the same image.
    const bool is_new =
        sums->images.empty() || sums->images.back().block != block;
    if (is_new) {
      sums->images.emplace_back();
      PointSums::Image& image = sums->images.back();
      image.block = block;
      image.information.noalias() = by_pose.transpose() * by_pose;
      image.mixed.noalias() = by_pose.transpose() * by_point;
      image.gradient.noalias() = by_pose.transpose() * residual;
    } else {
      PointSums::Image& image = sums->images.back();
      image.information.noalias() += by_pose.transpose() * by_pose;
      image.mixed.noalias() += by_pose.transpose() * by_point;
      image.gradient.noalias() += by_pose.transpose() * residual;
    }
  }
}

void BundleReducer::Damp(size_t point, PointSums* sums) const {
  Eigen::Matrix3d damped = sums->information;
  if (inverse_radius_ > 0.0) {
    damped.diagonal() += Damping<Eigen::Vector3d>(
        damped.diagonal(), point_scales_[point], inverse_radius_);
  }
  sums->covariance = damped.inverse();
  if (!sums->covariance.allFinite()) sums->covariance.setZero();
}

void BundleReducer::EliminatePoint(const PointSums& sums) {
  for (const PointSums::Image& col : sums.images) {
    const Eigen::Matrix<double, 6, 3> weighted = col.mixed * sums.covariance;
    const Eigen::Matrix<double, 3, 6> negative = -weighted.transpose();
    const std::lock_guard<std::mutex> lock(column_mutexes_[col.block]);
    const int first = matrix_.FirstColumnOf(col.block);
    whole_gradient_.segment<6>(first) += col.gradient;
    diagonal_.segment<6>(first) += col.information.diagonal();
    gradient_.segment<6>(first) += col.gradient - weighted * sums.gradient;
    Eigen::Matrix<double, 6, 6> values = col.information;
    values.noalias() += col.mixed * negative;
    matrix_.Add(col.block, col.block, values);
    for (const PointSums::Image& row : sums.images) {
      if (row.block <= col.block) continue;
      values.noalias() = row.mixed * negative;
      matrix_.Add(row.block, col.block, values);
    }
  }
}

BundleReducer::Step BundleReducer::Move(const Eigen::VectorXd& step) {
  last_points_.resize(bundle_.NumPointsApart());
  Step total = ForEachPoint([&](size_t point, PointSums* sums, Totals* part) {
                 Sum(point, sums);
                 Damp(point, sums);
                 MovePoint(step, point, *sums, &part->step);
               }).step;
  MoveOthers(step, &total);
  return total;
}

void BundleReducer::MovePoint(const Eigen::VectorXd& step, size_t point,
                              const PointSums& sums, Step* total) {
  Eigen::Vector3d pull = sums.gradient;
  double slope = 0.0;
  double bend = 0.0;
  for (const PointSums::Image& image : sums.images) {
    const Eigen::Matrix<double, 6, 1> of_pose =
        step.segment<6>(matrix_.FirstColumnOf(image.block));
    pull.noalias() += image.mixed.transpose() * of_pose;
    slope += image.gradient.dot(of_pose);
    bend += of_pose.dot(image.information * of_pose);
  }
  const Eigen::Vector3d moved = -sums.covariance * pull;
  slope += sums.gradient.dot(moved);
  bend += 2.0 * (pull - sums.gradient).dot(moved) +
          moved.dot(sums.information * moved);
  total->predicted_decrease -= slope + 0.5 * bend;
  Eigen::Vector3d& xyz = bundle_.PointApart(point);
  total->squared_norm += xyz.squaredNorm();
  total->squared_length += moved.squaredNorm();
  last_points_[point] = xyz;
  xyz += moved;
}

void BundleReducer::MoveOthers(const Eigen::VectorXd& step, Step* total) {
  for (const ceres::ResidualBlockId id : ids_) {
    Evaluate(id, true);
    Eigen::VectorXd change = Eigen::VectorXd::Zero(residuals_.size());
    for (const JacobianBlock& block : blocks_) {
      change += block.values * step.segment(matrix_.FirstColumnOf(block.block),
                                            block.values.cols());
    }
    total->predicted_decrease -= change.dot(residuals_ + 0.5 * change);
  }
  last_parameters_.resize(matrix_.NumColumns());
  for (int block = 0; block < matrix_.NumBlocks(); ++block) {
    const int first = matrix_.FirstColumnOf(block);
    Eigen::Map<Eigen::VectorXd> parameters(parameters_of_[block],
                                           matrix_.SizeOf(block));
    last_parameters_.segment(first, parameters.size()) = parameters;
    parameters += step.segment(first, parameters.size());
  }
  total->squared_norm += last_parameters_.squaredNorm();
  total->squared_length += step.squaredNorm();
}

void BundleReducer::TakeBack() {
  for (size_t k = 0; k < last_points_.size(); ++k) {
    bundle_.PointApart(k) = last_points_[k];
  }
  for (int block = 0; block < matrix_.NumBlocks(); ++block) {
    Eigen::Map<Eigen::VectorXd>(parameters_of_[block], matrix_.SizeOf(block)) =
        last_parameters_.segment(matrix_.FirstColumnOf(block),
                                 matrix_.SizeOf(block));
  }
}

double BundleReducer::Cost() {
  bundle_.UpdatePoses();
  const ceres::LossFunction* loss = bundle_.ReprojectionLoss();
  double cost = ForEachPoint([&](size_t point, PointSums*, Totals* part) {
                  for (const PointObservation& observation :
                       bundle_.ObservationsOf(point)) {
                    Eigen::Vector2d residual;
                    observation.Evaluate(bundle_.PointApart(point),
                                         residual.data(), nullptr, nullptr);
                    double rho[3] = {residual.squaredNorm(), 1.0, 0.0};
                    if (loss != nullptr) loss->Evaluate(rho[0], rho);
                    part->cost += 0.5 * rho[0];
                  }
                }).cost;
  for (const ceres::ResidualBlockId id : ids_) cost += Evaluate(id, true);
  return cost;
}

}  // namespace adasfm
