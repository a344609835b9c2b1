// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/odometry_chain.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "core/option_checker.h"
#include "core/so3.h"
#include "global/odometry/uncertain_motion.h"

namespace adasfm {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Columns of OdometryChain::Systematic: camera-IMU rotation, direction of
// driving, persistent error, the gyroscope's scales.
constexpr int kCameraImu = 4;
constexpr int kDriving = 7;
constexpr int kPersistent = 10;
constexpr int kGyroScale = 13;

// The prior's covariance with zeros for what it does not observe, which the
// counters of the nodes exclude from use.
Matrix6d ObservedCovariance(const RelativePosePrior& prior) {
  Matrix6d covariance = prior.covariance;
  if (!prior.HasRotation()) {
    covariance.topRows<3>().setZero();
    covariance.leftCols<3>().setZero();
  }
  if (!prior.HasMotion()) {
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

Eigen::Matrix3d CameraFromMiddle(const Rigid3d& motion) {
  return ExpSo3(0.5 * LogSo3(motion.rotation)).toRotationMatrix();
}

// The observed part of the motion, corrected by shared_rotation_errors.
Rigid3d ObservedMotion(const OdometryChainOptions& options,
                       const RelativePosePrior& prior) {
  const auto found = options.shared_rotation_errors.find(prior.drive);
  const SharedRotationErrors turns =
      found == options.shared_rotation_errors.end() ? SharedRotationErrors()
                                                    : found->second;
  Rigid3d motion;
  if (prior.HasRotation()) {
    const Eigen::Quaterniond camera_imu = ExpSo3(turns.camera_imu_rad);
    motion.rotation =
        camera_imu * prior.cam2_from_cam1.rotation * camera_imu.conjugate();
  }
  if (prior.HasMotion()) {
    motion.translation =
        ExpSo3(CameraFromMiddle(motion) * turns.driving_direction_rad) *
        prior.cam2_from_cam1.translation;
  }
  return motion;
}

// A root of the translation's covariance, or only of its part along the motion
// where vision has estimated the direction that all steps share.
Eigen::Matrix3d PersistentRoot(const OdometryChainOptions& options,
                               const RelativePosePrior& prior,
                               const Rigid3d& motion) {
  const Eigen::Matrix3d covariance =
      ObservedCovariance(prior).bottomRightCorner<3, 3>();
  if (options.shared_rotation_errors.count(prior.drive) == 0 ||
      !(motion.translation.squaredNorm() > 0.0)) {
    return SquareRoot(covariance);
  }
  const Eigen::Vector3d along = motion.translation.normalized();
  return std::sqrt(along.dot(covariance * along)) * along * along.transpose();
}

// d(error) of a step by the errors that all steps share (columns as in
// OdometryChain::Systematic).
Eigen::Matrix<double, 6, 16> SharedJacobian(const OdometryChainOptions& options,
                                            const RelativePosePrior& prior,
                                            const Rigid3d& motion) {
  Eigen::Matrix<double, 6, 16> jacobian = Eigen::Matrix<double, 6, 16>::Zero();
  const Eigen::Matrix3d camera_from_middle = CameraFromMiddle(motion);
  jacobian.block<3, 1>(3, 0) = motion.translation;
  jacobian.block<3, 3>(0, 1) = SecondsFromNs(prior.dt_ns) * camera_from_middle;
  jacobian.block<3, 3>(0, kCameraImu) =
      Eigen::Matrix3d::Identity() - motion.rotation.toRotationMatrix();
  jacobian.block<3, 3>(3, kDriving) =
      -Hat(motion.translation) * camera_from_middle;
  jacobian.block<3, 3>(3, kPersistent) = PersistentRoot(options, prior, motion);
  jacobian.block<3, 3>(0, kGyroScale) = LogSo3(motion.rotation).asDiagonal();
  return jacobian;
}

}  // namespace

bool OdometryChainOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .NotNegative(
          {{"scale_sigma", scale_sigma},
           {"gyro_bias_sigma_rad_s", gyro_bias_sigma_rad_s},
           {"gyro_bias_walk_rad_s_sqrt_s", gyro_bias_walk_rad_s_sqrt_s},
           {"gyro_scale_sigma", gyro_scale_sigma},
           {"extrinsic_rotation_sigma_rad", extrinsic_rotation_sigma_rad},
           {"driving_direction_sigma_rad", driving_direction_sigma_rad},
           {"persistent_translation_ratio", persistent_translation_ratio},
           {"scale_drift_ratio", scale_drift_ratio}})
      .AllHold();
}

OdometryChainOptions WithoutSharedErrors(const OdometryChainOptions& options) {
  OdometryChainOptions independent = options;
  independent.scale_sigma = 0.0;
  independent.gyro_bias_covariance = Eigen::Matrix3d::Zero();
  independent.gyro_scale_sigma = 0.0;
  independent.extrinsic_rotation_sigma_rad = 0.0;
  independent.driving_direction_sigma_rad = 0.0;
  independent.shared_rotation_errors.clear();
  independent.persistent_translation_ratio = 0.0;
  return independent;
}

OdometryChain::OdometryChain(const std::vector<RelativePosePrior>& priors,
                             const OdometryChainOptions& options,
                             const std::vector<RelativePosePrior>& frame_priors)
    : options_(options) {
  for (const RelativePosePrior& prior : frame_priors) {
    followers_[prior.image_id2] = {prior.image_id1,
                                   {prior.cam2_from_cam1, prior.covariance}};
  }
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
  // A piece starts at an image to which no prior leads. A ring, which is
  // impossible in time, has no such image and is left out.
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
    const Rigid3d motion = ObservedMotion(options_, prior);
    const Eigen::Vector3d place = node.cam_from_start.TargetOriginInSource();
    node.num_places += 1.0;
    node.place_sum += place;
    node.place_square_sum += place * place.transpose();
    node.image_id = prior.image_id2;
    node.drive = prior.drive;
    node.cam_from_start = motion * node.cam_from_start;
    node.num_without_rotation += !prior.HasRotation();
    node.num_without_position += !prior.HasMotion();

    const Matrix6d start_from_error = Adjoint(node.cam_from_start.Inverse()) *
                                      TwistFromError(motion.translation);
    node.covariance += start_from_error * ObservedCovariance(prior) *
                       start_from_error.transpose();
    const double dt_s = SecondsFromNs(prior.dt_ns);
    // A later bias differs from that at the piece's start by its random walk so
    // far.
    node.walk.seconds += dt_s;
    const auto gyro_sum = node.systematic.middleCols<3>(kGyro);
    node.walk.sum += dt_s * gyro_sum;
    node.walk.square_sum += dt_s * gyro_sum * gyro_sum.transpose();
    node.systematic +=
        start_from_error * SharedJacobian(options_, prior, motion);
    index_[node.image_id] = nodes_.size();
    nodes_.push_back(node);
  }
}

int OdometryChain::Index(image_t image_id) const {
  const auto follower = followers_.find(image_id);
  const auto it = index_.find(
      follower == followers_.end() ? image_id : follower->second.leader);
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
  return FromLeader(image_id).cam2_from_cam1 *
         nodes_.at(Index(image_id)).cam_from_start;
}

UncertainMotion OdometryChain::FromLeader(image_t image_id) const {
  const auto follower = followers_.find(image_id);
  return follower == followers_.end() ? UncertainMotion()
                                      : follower->second.follower_from_leader;
}

ChainMotion OdometryChain::Motion(image_t image_id1, image_t image_id2) const {
  ChainMotion motion = MotionOfLeaders(image_id1, image_id2);
  if (!IsFollower(image_id1) && !IsFollower(image_id2)) return motion;
  const UncertainMotion motion_of_followers =
      FromLeader(image_id2) *
      UncertainMotion{motion.cam2_from_cam1, motion.covariance} *
      FromLeader(image_id1).Inverse();
  motion.cam2_from_cam1 = motion_of_followers.cam2_from_cam1;
  motion.covariance = motion_of_followers.covariance;
  return motion;
}

// A change e of the scale at a place moves the later end by e (end - place):
// the sum of (end - place)(end - place)^T over the places.
Eigen::Matrix3d OdometryChain::SumOfScaleChanges(const Node& earlier,
                                                 const Node& later) {
  const Eigen::Vector3d end = later.cam_from_start.TargetOriginInSource();
  const Eigen::Matrix3d mixed =
      end * (later.place_sum - earlier.place_sum).transpose();
  return (later.num_places - earlier.num_places) * end * end.transpose() -
         mixed - mixed.transpose() + later.place_square_sum -
         earlier.place_square_sum;
}

// A bias increment at a step acts on all later steps: the sum over the steps k
// of dt_k (end - G_k)(end - G_k)^T, with G the gyro columns.
OdometryChain::Matrix6d OdometryChain::SumOfWalks(const Node& earlier,
                                                  const Node& later) {
  const Eigen::Matrix<double, 6, 3> end = later.systematic.middleCols<3>(kGyro);
  const Matrix6d mixed = end * (later.walk.sum - earlier.walk.sum).transpose();
  return (later.walk.seconds - earlier.walk.seconds) * end * end.transpose() -
         mixed - mixed.transpose() + later.walk.square_sum -
         earlier.walk.square_sum;
}

ChainMotion OdometryChain::MotionOfLeaders(image_t image_id1,
                                           image_t image_id2) const {
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
  Eigen::Matrix<double, 16, 1> sigmas;
  sigmas << options_.scale_sigma, Eigen::Vector3d::Zero(),
      Eigen::Vector3d::Constant(options_.extrinsic_rotation_sigma_rad),
      Eigen::Vector3d::Constant(options_.driving_direction_sigma_rad),
      Eigen::Vector3d::Constant(options_.persistent_translation_ratio),
      Eigen::Vector3d::Constant(options_.gyro_scale_sigma);
  Eigen::Matrix<double, 16, 16> shared = sigmas.cwiseAbs2().asDiagonal();
  shared.block<3, 3>(kGyro, kGyro) = options_.gyro_bias_covariance.value_or(
      std::pow(options_.gyro_bias_sigma_rad_s, 2) *
      Eigen::Matrix3d::Identity());
  // Where vision joins drives in one piece, those of the later one.
  const auto estimated = options_.shared_rotation_errors.find(later.drive);
  if (estimated != options_.shared_rotation_errors.end()) {
    shared.block<6, 6>(kCameraImu, kCameraImu) = estimated->second.covariance;
  }
  const Systematic systematic = later.systematic - earlier.systematic;
  const Matrix6d covariance_in_start =
      later.covariance - earlier.covariance +
      systematic * shared * systematic.transpose() +
      std::pow(options_.gyro_bias_walk_rad_s_sqrt_s, 2) *
          SumOfWalks(earlier, later);
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
