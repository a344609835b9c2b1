// SPDX-License-Identifier: BSD-3-Clause
// The part of BundleReducer on points that the problem keeps apart.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "colmap_ext/bundle_adjustment/bundle_reducer.h"
#include "colmap_ext/bundle_adjustment/damping.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// Points of a part are summed one by one, then the parts: the same order for
// any number of threads.
constexpr size_t kNumPointsOfPart = 32;
// Parts whose sums, some 10 kB a point, are in memory at the same time: as many
// as fit into the cache of a core.
constexpr size_t kNumPartsOfThread = 2;

}  // namespace

void BundleReducer::PointSums::SortImages() {
  order.resize(images.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return images[a].block < images[b].block; });
}

BundleReducer::Totals BundleReducer::AddUp(const std::vector<Totals>& parts) {
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

template <typename Function>
void BundleReducer::ForEachPoint(size_t begin, size_t end,
                                 const Function& function,
                                 std::vector<Totals>* parts) const {
  parts->resize((end + kNumPointsOfPart - 1) / kNumPointsOfPart);
  const size_t first_part = begin / kNumPointsOfPart;
  ParallelFor(num_threads_, parts->size() - first_part, [&](size_t k) {
    PointSums sums;
    const size_t first = (first_part + k) * kNumPointsOfPart;
    const size_t last = std::min(end, first + kNumPointsOfPart);
    for (size_t point = first; point < last; ++point) {
      function(point, &sums, &(*parts)[first_part + k]);
    }
  });
}

BundleReducer::Totals BundleReducer::LinearizePoints() {
  const size_t num_points = bundle_.NumPointsApart();
  const size_t num_at_once =
      kNumPointsOfPart * kNumPartsOfThread * EffectiveNumThreads(num_threads_);
  point_scales_.resize(num_points);
  std::vector<PointSums> points;
  std::vector<Totals> parts;
  for (size_t begin = 0; begin < num_points; begin += num_at_once) {
    points.resize(std::min(num_at_once, num_points - begin));
    LinearizePoints(begin, &points, &parts);
    Eliminate(points);
  }
  return AddUp(parts);
}

void BundleReducer::LinearizePoints(size_t begin,
                                    std::vector<PointSums>* points,
                                    std::vector<Totals>* parts) {
  // The scales of the poses are found at the end of the first call.
  const bool is_first = scales_.size() == 0;
  const auto linearize = [&](size_t point, PointSums*, Totals* part) {
    PointSums& sums = (*points)[point - begin];
    Sum(point, &sums);
    if (is_first) {
      point_scales_[point] =
          DampingScales<Eigen::Vector3d>(sums.information.diagonal());
    }
    Damp(point, &sums);
    sums.SortImages();
    part->cost += sums.cost;
    part->largest_gradient = std::max(part->largest_gradient,
                                      sums.gradient.lpNorm<Eigen::Infinity>());
  };
  ForEachPoint(begin, begin + points->size(), linearize, parts);
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
  const BundleProblem::ObservationRange observations =
      bundle_.ObservationsOf(point);
  sums->images.reserve(observations.last - observations.first);
  for (const PointObservation& observation : observations) {
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
    // A track may observe the same image twice.
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

// One thread adds to each column, in the order of the points; the column stays
// in the processor's cache meanwhile.
void BundleReducer::Eliminate(const std::vector<PointSums>& points) {
  ListColumns(points);
  ParallelFor(num_threads_, num_columns_,
              [&](size_t k) { AddToColumn(points, columns_[k]); });
  for (size_t k = 0; k < num_columns_; ++k) {
    column_of_block_[columns_[k].block] = -1;
  }
}

void BundleReducer::ListColumns(const std::vector<PointSums>& points) {
  num_columns_ = 0;
  for (size_t point = 0; point < points.size(); ++point) {
    const PointSums& sums = points[point];
    for (size_t i = 0; i < sums.order.size(); ++i) {
      const int block = sums.images[sums.order[i]].block;
      int& column = column_of_block_[block];
      if (column < 0) {
        column = static_cast<int>(num_columns_++);
        if (num_columns_ > columns_.size()) columns_.emplace_back();
        columns_[column].block = block;
        columns_[column].images.clear();
      }
      columns_[column].images.emplace_back(point, i);
    }
  }
}

void BundleReducer::AddToColumn(const std::vector<PointSums>& points,
                                const PointColumn& column) {
  // Row of another block in this column, by the index of that block's column.
  std::vector<int> row_of_column(num_columns_, -1);
  const std::vector<int>& rows = matrix_.RowsOf(column.block);
  for (size_t k = 0; k < rows.size(); ++k) {
    const int other = column_of_block_[rows[k]];
    if (other >= 0) row_of_column[other] = k;
  }
  const int first = matrix_.FirstColumnOf(column.block);
  for (const auto& [point, i] : column.images) {
    const PointSums& sums = points[point];
    const PointSums::Image& image = sums.images[sums.order[i]];
    const Eigen::Matrix<double, 3, 6> negative =
        -(image.mixed * sums.covariance).transpose();
    diagonal_.segment<6>(first) += image.information.diagonal();
    whole_gradient_.segment<6>(first) += image.gradient;
    gradient_.segment<6>(first) +=
        image.gradient + negative.transpose() * sums.gradient;
    Eigen::Matrix<double, 6, 6> diagonal = image.information;
    diagonal.noalias() += image.mixed * negative;
    matrix_.Add(column.block, column.block, diagonal);
    for (size_t j = i + 1; j < sums.order.size(); ++j) {
      const PointSums::Image& row = sums.images[sums.order[j]];
      matrix_.AddProduct<6, 6>(column.block,
                               row_of_column[column_of_block_[row.block]],
                               row.mixed, negative);
    }
  }
}

BundleReducer::Step BundleReducer::Move(const Eigen::VectorXd& step,
                                        bool by_inverse_distance) {
  last_points_.resize(bundle_.NumPointsApart());
  std::vector<Totals> parts;
  const auto move = [&](size_t point, PointSums* sums, Totals* part) {
    Sum(point, sums);
    Damp(point, sums);
    MovePoint(step, by_inverse_distance, point, *sums, &part->step);
  };
  ForEachPoint(0, bundle_.NumPointsApart(), move, &parts);
  Step total = AddUp(parts).step;
  MoveOthers(step, &total);
  return total;
}

void BundleReducer::MovePoint(const Eigen::VectorXd& step,
                              bool by_inverse_distance, size_t point,
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
  if (!by_inverse_distance) {
    xyz += moved;
    return;
  }
  const AdjustedPose& first = *bundle_.ObservationsOf(point).begin()->pose;
  const int block = block_of_pose_[&first - bundle_.Poses().data()];
  Eigen::Vector3d center_step = Eigen::Vector3d::Zero();
  if (block >= 0) {
    center_step = step.segment<3>(matrix_.FirstColumnOf(block) + 3);
  }
  xyz = first.center + center_step +
        MoveByInverseDistance(xyz - first.center, moved - center_step);
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

double BundleReducer::MinimizePoints(const MinimizePointOptions& options) {
  bundle_.UpdatePoses();
  std::vector<Totals> parts;
  const auto minimize = [&](size_t point, PointSums*, Totals* part) {
    part->cost +=
        MinimizePoint(options, bundle_.ObservationsOf(point),
                      bundle_.ReprojectionLoss(), &bundle_.PointApart(point));
  };
  ForEachPoint(0, bundle_.NumPointsApart(), minimize, &parts);
  double cost = AddUp(parts).cost;
  for (const ceres::ResidualBlockId id : ids_) cost += Evaluate(id, true);
  return cost;
}

}  // namespace adasfm
