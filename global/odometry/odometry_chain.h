// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"
#include "global/odometry/uncertain_motion.h"

namespace adasfm {

// Visual corrections that the priors of a drive share
// (CorrectCameraImuRotation), rad.
// Their rotations R become Exp(camera_imu) R Exp(-camera_imu), their
// translations t become Exp(H driving_direction) t, where H rotates from the
// camera halfway to the later camera.
struct SharedRotationErrors {
  Eigen::Vector3d camera_imu_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d driving_direction_rad = Eigen::Vector3d::Zero();
  // Of both in this order, rad^2.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

// Errors that all steps of a drive share. They grow with the length of the
// path, not with its root, and dominate after kilometres.
struct OdometryChainOptions {
  // 1 sigma of the wheels' common scale error.
  double scale_sigma = 0.01;
  // Covariance of the remaining gyro bias in the camera frame, rad^2/s^2, as
  // the import states it.
  std::optional<Eigen::Matrix3d> gyro_bias_covariance;
  // 1 sigma per axis of the gyro bias where no covariance is stated, rad/s, and
  // of its random walk, rad/s/sqrt(s).
  double gyro_bias_sigma_rad_s = 2e-4;
  double gyro_bias_walk_rad_s_sqrt_s = 2e-5;
  // 1 sigma of the gyroscope's scale error about each axis of the camera; half
  // of what data sheets state, as false loops pass a wider test.
  // Misalignments, which turn a bend into a climb, would hide the floors of a
  // car park.
  double gyro_scale_sigma = 0.005;
  // 1 sigma, per axis, of the rotation of T_cam_imu and of the direction of
  // driving in the camera, rad.
  double extrinsic_rotation_sigma_rad = 5e-3;
  double driving_direction_sigma_rad = 0.01;
  // Visual estimates of both by drive (RelativePosePrior::drive), whose
  // covariance replaces these sigmas.
  std::map<int, SharedRotationErrors> shared_rotation_errors;
  // The steps of a smoothed drive share errors of tilt and velocity: this many
  // sigmas of their translations persist from step to step, besides the part
  // that changes. In drives of shared_rotation_errors, only the part along the
  // motion persists.
  double persistent_translation_ratio = 1.0;
  // 1 sigma, as a ratio, of the scale change at each step, which lasts for all
  // later steps. Visual odometry alone does not constrain its scale.
  double scale_drift_ratio = 0.0;

  bool IsValid(std::string* error) const;
};

// Sets the errors that all steps share to zero. The gyro bias's random walk and
// the scale drift stay.
OdometryChainOptions WithoutSharedErrors(const OdometryChainOptions& options);

// The motion between any two images of the chain.
struct ChainMotion {
  // All steps between the images have the part in question. Only then are the
  // values below meaningful.
  bool has_rotation = false;
  bool has_position = false;
  Rigid3d cam2_from_cam1;
  // As RelativePosePrior::covariance.
  Eigen::Matrix<double, 6, 6> covariance;
};

// The priors of consecutive images composed, with their covariance
// (docs/reference/global.md). Each step's error is transformed to the frame of
// the chain's start, where errors of different steps add up; so prefix sums
// give the covariance between any two images in constant time.
class OdometryChain {
 public:
  OdometryChain() = default;
  // Priors of consecutive images in any order; each image has at most one
  // prior to a later and one from an earlier image (else the first by ids
  // counts). Missing priors split the chain. frame_priors: from an image to
  // those of other cameras of the same frame (core/camera_rig.h), which follow
  // it: they have its place in the chain and their own pose.
  OdometryChain(const std::vector<RelativePosePrior>& priors,
                const OdometryChainOptions& options,
                const std::vector<RelativePosePrior>& frame_priors = {});

  bool empty() const { return nodes_.empty(); }
  // Whether the chain leads from one image to the other.
  bool IsConnected(image_t image_id1, image_t image_id2) const;
  // Steps from image 1 to image 2, negative when image 2 is the earlier one.
  // Both must be connected.
  int NumSteps(image_t image_id1, image_t image_id2) const;
  // Images must be connected; either order.
  ChainMotion Motion(image_t image_id1, image_t image_id2) const;
  // The position of an image in the whole sequence, pieces one after the
  // other; -1 when it is in no piece.
  int Index(image_t image_id) const;
  bool IsFollower(image_t image_id) const {
    return followers_.count(image_id) > 0;
  }
  int Piece(image_t image_id) const;  // -1 when absent
  // Poses in the frame of the piece's first image.
  Rigid3d CamFromStart(image_t image_id) const;

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  // Derivatives by the scale, the gyro bias, the rotation of T_cam_imu, the
  // direction of driving, the persistent translation error and the gyroscope's
  // scales.
  using Systematic = Eigen::Matrix<double, 6, 16>;
  static constexpr int kGyro = 1;  // first of its columns
  // Prefix sums, weighted by time, of the gyro columns of Systematic before
  // each step.
  struct Walk {
    double seconds = 0.0;
    Eigen::Matrix<double, 6, 3> sum = Eigen::Matrix<double, 6, 3>::Zero();
    Matrix6d square_sum = Matrix6d::Zero();
  };
  struct Node {
    image_t image_id = kInvalidImageId;
    int piece = -1;
    int drive = 0;  // of the step to this node
    Rigid3d cam_from_start;
    // Prefix sums over the piece's steps up to this node.
    Matrix6d covariance = Matrix6d::Zero();
    Systematic systematic = Systematic::Zero();
    Walk walk;
    // Of the places where the scale may change: their number, sum and sum of
    // outer products.
    double num_places = 0.0;
    Eigen::Vector3d place_sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d place_square_sum = Eigen::Matrix3d::Zero();
    int num_without_rotation = 0;
    int num_without_position = 0;
  };
  static Eigen::Matrix3d SumOfScaleChanges(const Node& earlier,
                                           const Node& later);
  static Matrix6d SumOfWalks(const Node& earlier, const Node& later);
  void AppendPiece(image_t first, const std::map<image_t, int>& next,
                   const std::vector<RelativePosePrior>& priors);

  struct Follower {
    image_t leader = kInvalidImageId;
    UncertainMotion follower_from_leader;
  };
  // The motion between the leaders of both images.
  ChainMotion MotionOfLeaders(image_t image_id1, image_t image_id2) const;
  // From the leader; the identity, with no error, for an image that follows
  // none.
  UncertainMotion FromLeader(image_t image_id) const;

  OdometryChainOptions options_;
  std::map<image_t, Follower> followers_;
  std::vector<Node> nodes_;
  std::map<image_t, int> index_;
  int num_pieces_ = 0;
};

}  // namespace adasfm
