// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/odometry_chain.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "core/so3.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A small error (dtheta, dt) in the frame of a camera, as RelativePosePrior
// states it (R_true = Exp(dtheta) R, t_true = t + dt), is the twist
// xi = (dtheta, dt - dtheta x t) of P_true = exp(xi) P.
Matrix6d TwistFromError(const Eigen::Vector3d& translation) {
  Matrix6d matrix = Matrix6d::Identity();
  matrix.bottomLeftCorner<3, 3>() = Hat(translation);
  return matrix;
}

// The same twist seen from another frame: (R omega, R v + t x R omega).
Matrix6d Adjoint(const Rigid3d& target_from_source) {
  const Eigen::Matrix3d rotation =
      target_from_source.rotation.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  adjoint.bottomLeftCorner<3, 3>() =
      Hat(target_from_source.translation) * rotation;
  return adjoint;
}

bool HasPosition(const RelativePosePrior& prior) {
  return prior.HasRotation() && prior.HasDirection() && prior.HasLength();
}

// The prior's covariance with zeros for what it does not observe, which the
// counters of the nodes exclude from use.
Matrix6d ObservedCovariance(const RelativePosePrior& prior) {
  Matrix6d covariance = prior.covariance;
  if (!prior.HasRotation()) {
    covariance.topRows<3>().setZero();
    covariance.leftCols<3>().setZero();
  }
  if (!HasPosition(prior)) {
    covariance.bottomRows<3>().setZero();
    covariance.rightCols<3>().setZero();
  }
  return covariance.allFinite() ? covariance : Matrix6d::Zero();
}

Eigen::Matrix3d SquareRoot(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  return eigen.eigenvectors() *
         eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

// The part of the motion that was observed.
Rigid3d ObservedMotion(const RelativePosePrior& prior) {
  Rigid3d motion;
  if (prior.HasRotation()) motion.rotation = prior.cam2_from_cam1.rotation;
  if (HasPosition(prior)) motion.translation = prior.cam2_from_cam1.translation;
  return motion;
}

}  // namespace

bool OdometryChainOptions::IsValid(std::string* error) const {
  if (!(scale_sigma >= 0.0)) {
    *error = "scale_sigma = " + std::to_string(scale_sigma) + " must be >= 0";
    return false;
  }
  if (!(gyro_bias_sigma_rad_s >= 0.0)) {
    *error =
        "gyro_bias_sigma_rad_s = " + std::to_string(gyro_bias_sigma_rad_s) +
        " must be >= 0";
    return false;
  }
  if (!(persistent_translation_ratio >= 0.0)) {
    *error = "persistent_translation_ratio = " +
             std::to_string(persistent_translation_ratio) + " must be >= 0";
    return false;
  }
  if (!(scale_drift_ratio >= 0.0)) {
    *error = "scale_drift_ratio = " + std::to_string(scale_drift_ratio) +
             " must be >= 0";
    return false;
  }
  return true;
}

OdometryChain::OdometryChain(const std::vector<RelativePosePrior>& priors,
                             const OdometryChainOptions& options)
    : options_(options) {
  std::vector<RelativePosePrior> sorted = priors;
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
    return std::tie(a.image_id1, a.image_id2) <
           std::tie(b.image_id1, b.image_id2);
  });
  std::map<image_t, int> next;
  std::set<image_t> has_previous;
  for (size_t k = 0; k < sorted.size(); ++k) {
    const RelativePosePrior& prior = sorted[k];
    if (prior.image_id1 == prior.image_id2) continue;
    if (next.count(prior.image_id1) || has_previous.count(prior.image_id2)) {
      continue;
    }
    next[prior.image_id1] = k;
    has_previous.insert(prior.image_id2);
  }
  // A piece starts where no prior leads; a ring has no such image and is left
  // out: time does not run in circles.
  for (const auto& [image_id, step] : next) {
    if (!has_previous.count(image_id)) AppendPiece(image_id, next, sorted);
  }
}

void OdometryChain::AppendPiece(image_t first,
                                const std::map<image_t, int>& next,
                                const std::vector<RelativePosePrior>& priors) {
  Node node;
  node.image_id = first;
  node.piece = num_pieces_++;
  index_[first] = nodes_.size();
  nodes_.push_back(node);
  for (auto it = next.find(first); it != next.end();
       it = next.find(node.image_id)) {
    const RelativePosePrior& prior = priors[it->second];
    const Rigid3d motion = ObservedMotion(prior);
    const Eigen::Vector3d place = node.cam_from_start.TargetOriginInSource();
    node.num_places += 1.0;
    node.place_sum += place;
    node.place_square_sum += place * place.transpose();
    node.image_id = prior.image_id2;
    node.cam_from_start = motion * node.cam_from_start;
    node.num_without_rotation += !prior.HasRotation();
    node.num_without_position += !HasPosition(prior);

    const Matrix6d start_from_error = Adjoint(node.cam_from_start.Inverse()) *
                                      TwistFromError(motion.translation);
    node.covariance += start_from_error * ObservedCovariance(prior) *
                       start_from_error.transpose();
    // d(error) / d(scale, gyro bias, persistent translation error) of this
    // step.
    Systematic systematic = Systematic::Zero();
    systematic.block<3, 1>(3, 0) = motion.translation;
    systematic.block<3, 3>(0, 1) =
        SecondsFromNs(prior.dt_ns) * Eigen::Matrix3d::Identity();
    systematic.block<3, 3>(3, 4) =
        SquareRoot(ObservedCovariance(prior).bottomRightCorner<3, 3>());
    node.systematic += start_from_error * systematic;
    index_[node.image_id] = nodes_.size();
    nodes_.push_back(node);
  }
}

int OdometryChain::Index(image_t image_id) const {
  const auto it = index_.find(image_id);
  return it == index_.end() ? -1 : it->second;
}

int OdometryChain::Piece(image_t image_id) const {
  const int index = Index(image_id);
  return index < 0 ? -1 : nodes_[index].piece;
}

bool OdometryChain::IsConnected(image_t image_id1, image_t image_id2) const {
  const int piece = Piece(image_id1);
  return piece >= 0 && piece == Piece(image_id2);
}

int OdometryChain::NumSteps(image_t image_id1, image_t image_id2) const {
  if (!IsConnected(image_id1, image_id2)) {
    throw std::invalid_argument("OdometryChain: images are not connected");
  }
  return Index(image_id2) - Index(image_id1);
}

Rigid3d OdometryChain::CamFromStart(image_t image_id) const {
  return nodes_.at(index_.at(image_id)).cam_from_start;
}

// A change e of the scale at a place moves the later end by e times the way
// from that place to it: the sum of the ways' outer products, over the places.
Eigen::Matrix3d OdometryChain::SumOfScaleChanges(const Node& earlier,
                                                 const Node& later) {
  const Eigen::Vector3d end = later.cam_from_start.TargetOriginInSource();
  const Eigen::Matrix3d mixed =
      end * (later.place_sum - earlier.place_sum).transpose();
  return (later.num_places - earlier.num_places) * end * end.transpose() -
         mixed - mixed.transpose() + later.place_square_sum -
         earlier.place_square_sum;
}

ChainMotion OdometryChain::Motion(image_t image_id1, image_t image_id2) const {
  const int num_steps = NumSteps(image_id1, image_id2);
  const Node& node1 = nodes_[Index(image_id1)];
  const Node& node2 = nodes_[Index(image_id2)];
  const Node& earlier = num_steps < 0 ? node2 : node1;
  const Node& later = num_steps < 0 ? node1 : node2;

  ChainMotion motion;
  motion.has_rotation =
      earlier.num_without_rotation == later.num_without_rotation;
  motion.has_position =
      earlier.num_without_position == later.num_without_position;
  motion.cam2_from_cam1 = node2.cam_from_start * node1.cam_from_start.Inverse();

  // In the start's frame the errors of the steps add up; the error's sign does
  // not matter to a covariance, so both directions of travel are one formula.
  Eigen::Matrix<double, 7, 1> variances;
  variances << std::pow(options_.scale_sigma, 2),
      Eigen::Vector3d::Constant(std::pow(options_.gyro_bias_sigma_rad_s, 2)),
      Eigen::Vector3d::Constant(
          std::pow(options_.persistent_translation_ratio, 2));
  const Systematic systematic = later.systematic - earlier.systematic;
  const Matrix6d covariance_in_start =
      later.covariance - earlier.covariance +
      systematic * variances.asDiagonal() * systematic.transpose();
  const Matrix6d error_from_start =
      TwistFromError(motion.cam2_from_cam1.translation).inverse() *
      Adjoint(node2.cam_from_start);
  motion.covariance =
      error_from_start * covariance_in_start * error_from_start.transpose();
  const Eigen::Matrix3d rotation =
      node2.cam_from_start.rotation.toRotationMatrix();
  motion.covariance.bottomRightCorner<3, 3>() +=
      std::pow(options_.scale_drift_ratio, 2) * rotation *
      SumOfScaleChanges(earlier, later) * rotation.transpose();
  return motion;
}

}  // namespace adasfm
