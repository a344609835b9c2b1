// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/inertial_motion.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"
#include "global/odometry/inertial_scale.h"

namespace adasfm {

inline constexpr int kNoModel = -1;

// Consecutive images, with a motion and a rotation from each to the next.
struct DriveChain {
  std::vector<image_t> images;
  std::vector<const InertialMotion*> motions;
  std::vector<size_t> priors;  // indices
  // Of each image, the index of its model, or kNoModel.
  std::vector<int> models;
};

struct DriveGap {
  // The last image before the gap and the first one after it.
  size_t first = 0;
  size_t last = 0;
};

// A model in its own unit, and its scale where it is known.
struct SizedModel {
  std::map<image_t, Rigid3d> cams_from_world;
  std::optional<InertialScale> scale;
};

// Motion across one gap (docs/reference/math.md, Across a gap): the linear
// smoother of BridgeGaps, in the frame of the model on the near side, in
// metres. The referenced arguments must outlive the object.
class GapSmoother {
 public:
  // 1 sigma of an image's position in its model, per axis, m.
  static constexpr double kPositionSigmaM = 0.01;

  GapSmoother(const std::vector<RelativePosePrior>& priors,
              const std::vector<SizedModel>& models, const DriveChain& chain,
              const DriveGap& gap);

  double Seconds() const;
  // False when the equations have no solution.
  bool Solve();
  // Scale of the model on one side.
  InertialScale Scale(bool is_far) const;
  // The translations of the gap's steps, in the convention of priors.
  std::vector<MeasuredTranslation> Steps() const;

 private:
  static constexpr int kNumOfImage = 6;  // position of the IMU, velocity
  // Gravity, bias, place of the far side, size of the near and the far side.
  static constexpr int kNumShared = 11;

  // The coefficients of an unknown.
  using Factor =
      Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

  bool IsOf(size_t k, size_t side) const {
    return chain_.models[k] == chain_.models[side];
  }
  int Position(size_t k) const {
    return kNumOfImage * static_cast<int>(k - first_);
  }
  int Velocity(size_t k) const { return Position(k) + 3; }
  int Gravity() const { return kNumOfImage * static_cast<int>(NumImages()); }
  int Bias() const { return Gravity() + 3; }
  int FarSide() const { return Gravity() + 6; }
  int NearSize() const { return Gravity() + 9; }
  int FarSize() const { return NearSize() + 1; }
  size_t NumImages() const { return last_ - first_ + 1; }

  const Rigid3d& CamFromModel(size_t k) const {
    return models_[chain_.models[k]].cams_from_world.at(chain_.images[k]);
  }
  Eigen::Vector3d CenterInModel(size_t k) const {
    return CamFromModel(k).TargetOriginInSource();
  }
  const Eigen::Quaterniond& WorldFromCam(size_t k) const {
    return world_from_cams_[k - first_];
  }
  Eigen::Vector3d Lever(size_t k) const {
    const InertialMotion& motion =
        *chain_.motions[std::min(k, chain_.motions.size() - 1)];
    return WorldFromCam(k) * motion.camera_from_imu_origin;
  }
  Eigen::Vector3d Center(size_t k) const {
    return solution_.segment<3>(Position(k)) + Lever(k);
  }

  // In the frame of the near side; the priors connect the far side.
  void FindRotations();
  // An equation in each axis: the factors times their unknowns add up to the
  // value, with this sigma.
  void AddEquation(const std::vector<std::pair<int, Factor>>& blocks,
                   const Eigen::Vector3d& value, double sigma);
  // gravity: gives its direction; zero while unknown.
  void BuildEquations(const Eigen::Vector3d& gravity);
  void AddSize(size_t side, int size);
  void AddMotion(size_t k);
  // Covariance of the translation from one side to the other, in the frame of
  // the near side. Errors of the rotations tilt gravity, the more the longer
  // the gap is.
  Eigen::Matrix3d Covariance() const;

  const std::vector<RelativePosePrior>& priors_;
  const std::vector<SizedModel>& models_;
  const DriveChain& chain_;
  const DriveGap gap_;
  // The first and the last image of the smoother.
  size_t first_ = 0;
  size_t last_ = 0;
  std::vector<Eigen::Quaterniond> world_from_cams_;
  Eigen::Quaterniond near_from_far_ = Eigen::Quaterniond::Identity();
  Eigen::Matrix3d rotation_covariance_ = Eigen::Matrix3d::Zero();
  std::vector<Eigen::Triplet<double>> hessian_;
  Eigen::VectorXd right_;
  double squares_ = 0.0;
  int num_residuals_ = 0;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor_;
  Eigen::VectorXd solution_;
  double variance_factor_ = 1.0;
};

}  // namespace adasfm
