// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/bridge_gaps.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "global/odometry/inertial_scale.h"

namespace adasfm {
namespace {

constexpr double kGravityMps2 = 9.81;         // m/s^2
constexpr double kGravitySizeSigma = 0.02;    // of its size
constexpr double kBiasSigma = 0.3;            // m/s^2, an axis
constexpr double kAccelerometerNoise = 0.03;  // m/s^2 sqrt(s)
constexpr double kPositionSigmaM = 0.01;      // of a model's image, an axis
// Of a step that vision and the size tell.
constexpr double kStepSigmaRatio = 0.02;
// Of the smoother, on each side: enough for the velocity, gravity and bias.
constexpr double kSideS = 5.0;
constexpr size_t kMaxNumImagesOfSide = 50;
constexpr size_t kMinNumImagesOfSide = 8;
// Of a model whose size is found across a gap.
constexpr double kMaxFoundSizeSigma = 0.1;
// Longer ones are known to metres only.
constexpr double kMaxGapS = 20.0;
constexpr int kNoModel = -1;

// Images in a row, with a motion and a rotation from each to the next.
struct Chain {
  std::vector<image_t> images;
  std::vector<const InertialMotion*> motions;
  std::vector<size_t> priors;  // indices
  // By models, or kNoModel.
  std::vector<int> models;
};

struct Gap {
  // The last image before it and the first one behind it.
  size_t first = 0;
  size_t last = 0;
};

// A model in its own unit, and what the accelerometer tells of that.
struct Model {
  std::map<image_t, Rigid3d> cams_from_world;
  std::optional<InertialScale> scale;
};

std::vector<Chain> FindChains(const std::vector<InertialMotion>& motions,
                              const std::vector<RelativePosePrior>& priors) {
  std::map<ImagePair, size_t> rotations;
  for (size_t k = 0; k < priors.size(); ++k) {
    if (priors[k].HasRotation()) {
      rotations[ImagePair(priors[k].image_id1, priors[k].image_id2)] = k;
    }
  }
  std::vector<Chain> chains;
  for (const InertialMotion& motion : motions) {
    const auto rotation =
        rotations.find(ImagePair(motion.image_id1, motion.image_id2));
    if (rotation == rotations.end() ||
        priors[rotation->second].image_id1 != motion.image_id1) {
      continue;
    }
    if (chains.empty() || chains.back().images.back() != motion.image_id1) {
      chains.emplace_back();
      chains.back().images.push_back(motion.image_id1);
    }
    Chain& chain = chains.back();
    chain.images.push_back(motion.image_id2);
    chain.motions.push_back(&motion);
    chain.priors.push_back(rotation->second);
  }
  return chains;
}

// Which model each image is in; runs that are too short to tell a velocity are
// in none.
void LabelImages(const std::vector<Model>& models, Chain* chain) {
  for (const image_t image_id : chain->images) {
    int label = kNoModel;
    for (size_t k = 0; k < models.size() && label == kNoModel; ++k) {
      if (models[k].cams_from_world.count(image_id) == 0) continue;
      label = static_cast<int>(k);
    }
    chain->models.push_back(label);
  }
  for (size_t first = 0; first < chain->models.size();) {
    size_t end = first;
    while (end < chain->models.size() &&
           chain->models[end] == chain->models[first]) {
      ++end;
    }
    if (end - first < kMinNumImagesOfSide) {
      std::fill(chain->models.begin() + first, chain->models.begin() + end,
                kNoModel);
    }
    first = end;
  }
}

std::vector<Gap> FindGaps(const Chain& chain) {
  std::vector<Gap> gaps;
  std::optional<size_t> last_known;
  for (size_t k = 0; k < chain.models.size(); ++k) {
    if (chain.models[k] == kNoModel) continue;
    if (last_known &&
        (k > *last_known + 1 || chain.models[k] != chain.models[*last_known])) {
      gaps.push_back({*last_known, k});
    }
    last_known = k;
  }
  return gaps;
}

// The way across a gap.
class GapSmoother {
 public:
  GapSmoother(const std::vector<RelativePosePrior>& priors,
              const std::vector<Model>& models, const Chain& chain,
              const Gap& gap)
      : priors_(priors), models_(models), chain_(chain), gap_(gap) {
    first_ = gap.first;
    last_ = gap.last;
    double seconds = 0.0;
    while (first_ > 0 && IsOf(first_ - 1, gap.first) && seconds < kSideS &&
           gap.first - first_ + 1 < kMaxNumImagesOfSide) {
      seconds += chain.motions[--first_]->dt_s;
    }
    seconds = 0.0;
    while (last_ + 1 < chain.images.size() && IsOf(last_ + 1, gap.last) &&
           seconds < kSideS && last_ - gap.last + 1 < kMaxNumImagesOfSide) {
      seconds += chain.motions[last_++]->dt_s;
    }
    FindRotations();
  }

  double Seconds() const {
    double seconds = 0.0;
    for (size_t k = gap_.first; k < gap_.last; ++k) {
      seconds += chain_.motions[k]->dt_s;
    }
    return seconds;
  }

  // False when the equations have no solution.
  bool Solve() {
    // Which way gravity points the first solution tells.
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
    for (int iteration = 0; iteration < 3; ++iteration) {
      BuildEquations(gravity);
      Eigen::SparseMatrix<double> hessian(right_.size(), right_.size());
      hessian.setFromTriplets(hessian_.begin(), hessian_.end());
      factor_.compute(hessian);
      if (factor_.info() != Eigen::Success) return false;
      solution_ = factor_.solve(right_);
      if (!solution_.allFinite()) return false;
      gravity = solution_.segment<3>(Gravity());
    }
    const double chi2 = squares_ - solution_.dot(right_);
    variance_factor_ = std::max(
        1.0,
        chi2 / std::max(1, num_residuals_ - static_cast<int>(right_.size())));
    return true;
  }

  // Of the model on one side.
  InertialScale Scale(bool is_far) const {
    const int size = is_far ? FarSize() : NearSize();
    const Eigen::VectorXd unit = Eigen::VectorXd::Unit(right_.size(), size);
    const double variance = factor_.solve(unit)[size];
    InertialScale scale;
    scale.metres_per_unit = solution_[size];
    scale.sigma_ratio =
        std::sqrt(variance_factor_ * variance) / solution_[size];
    return scale;
  }

  // The translations of the steps of the gap.
  std::vector<MeasuredTranslation> Steps() const {
    const Eigen::Matrix3d covariance = Covariance();
    const double seconds = Seconds();
    std::vector<MeasuredTranslation> steps;
    for (size_t k = gap_.first; k < gap_.last; ++k) {
      const Eigen::Matrix3d cam_from_world =
          WorldFromCam(k + 1).conjugate().toRotationMatrix();
      MeasuredTranslation step;
      step.translation = cam_from_world * (Center(k) - Center(k + 1));
      step.covariance = chain_.motions[k]->dt_s / seconds * cam_from_world *
                        covariance * cam_from_world.transpose();
      steps.push_back(step);
    }
    return steps;
  }

 private:
  static constexpr int kNumOfImage = 6;  // position of the IMU, velocity
  // Gravity, bias, place of the far side, size of the near and the far side.
  static constexpr int kNumShared = 11;

  // Of an unknown.
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

  // In the frame of the near side; the far side as the priors turn.
  void FindRotations() {
    world_from_cams_.resize(NumImages());
    for (size_t k = first_; k <= gap_.first; ++k) {
      world_from_cams_[k - first_] = CamFromModel(k).rotation.conjugate();
    }
    for (size_t k = gap_.first; k < gap_.last; ++k) {
      const RelativePosePrior& prior = priors_[chain_.priors[k]];
      world_from_cams_[k + 1 - first_] =
          WorldFromCam(k) * prior.cam2_from_cam1.rotation.conjugate();
      rotation_covariance_ += prior.covariance.topLeftCorner<3, 3>();
    }
    near_from_far_ = WorldFromCam(gap_.last) * CamFromModel(gap_.last).rotation;
    for (size_t k = gap_.last + 1; k <= last_; ++k) {
      world_from_cams_[k - first_] =
          near_from_far_ * CamFromModel(k).rotation.conjugate();
    }
  }

  // An equation in each axis: the blocks times these matrices add up to the
  // value, but for this sigma.
  void AddEquation(const std::vector<std::pair<int, Factor>>& blocks,
                   const Eigen::Vector3d& value, double sigma) {
    const double information = 1.0 / (sigma * sigma);
    for (const auto& [row, left] : blocks) {
      right_.segment(row, left.cols()) +=
          information * left.transpose() * value;
      for (const auto& [column, across] : blocks) {
        const Eigen::MatrixXd block = information * left.transpose() * across;
        for (int i = 0; i < block.rows(); ++i) {
          for (int j = 0; j < block.cols(); ++j) {
            hessian_.emplace_back(row + i, column + j, block(i, j));
          }
        }
      }
    }
    squares_ += information * value.squaredNorm();
    num_residuals_ += 3;
  }

  void BuildEquations(const Eigen::Vector3d& gravity) {
    const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
    const int size = Gravity() + kNumShared;
    hessian_.clear();
    right_ = Eigen::VectorXd::Zero(size);
    squares_ = 0.0;
    num_residuals_ = 0;
    for (size_t k = first_; k <= gap_.first; ++k) {
      AddEquation({{Position(k), one},
                   {NearSize(), CenterInModel(gap_.first) - CenterInModel(k)}},
                  -Lever(k), kPositionSigmaM);
    }
    for (size_t k = gap_.last; k <= last_; ++k) {
      AddEquation({{Position(k), one},
                   {FarSide(), one},
                   {FarSize(), near_from_far_ * (CenterInModel(gap_.last) -
                                                 CenterInModel(k))}},
                  -Lever(k), kPositionSigmaM);
    }
    AddSize(gap_.first, NearSize());
    AddSize(gap_.last, FarSize());
    for (size_t k = first_; k < last_; ++k) AddMotion(k);
    AddEquation({{Bias(), one}}, Eigen::Vector3d::Zero(), kBiasSigma);
    if (gravity.squaredNorm() > 0.0) {
      const Eigen::Vector3d down = gravity.normalized();
      AddEquation({{Gravity(), down * down.transpose()}}, kGravityMps2 * down,
                  kGravitySizeSigma);
    }
  }

  void AddSize(size_t side, int size) {
    const std::optional<InertialScale>& scale =
        models_[chain_.models[side]].scale;
    if (!scale) return;
    AddEquation({{size, Eigen::Vector3d::UnitX()}},
                scale->metres_per_unit * Eigen::Vector3d::UnitX(),
                scale->metres_per_unit * scale->sigma_ratio);
  }

  void AddMotion(size_t k) {
    const InertialMotion& motion = *chain_.motions[k];
    const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d turn = WorldFromCam(k).toRotationMatrix();
    const double dt = motion.dt_s;
    AddEquation({{Velocity(k + 1), one},
                 {Velocity(k), -one},
                 {Gravity(), -dt * one},
                 {Bias(), -turn * motion.velocity_by_bias}},
                turn * motion.delta_velocity,
                kAccelerometerNoise * std::sqrt(dt));
    // With the mean of both velocities, so that the noise of the velocity is
    // not in it.
    AddEquation(
        {{Position(k + 1), one},
         {Position(k), -one},
         {Velocity(k), -0.5 * dt * one},
         {Velocity(k + 1), -0.5 * dt * one},
         {Bias(), turn * (0.5 * dt * motion.velocity_by_bias -
                          motion.position_by_bias)}},
        turn * (motion.delta_position - 0.5 * dt * motion.delta_velocity),
        kAccelerometerNoise * dt * std::sqrt(dt / 12.0));
  }

  // Of the way from one side to the other, in the frame of the near side. What
  // the rotations err by tilts gravity, the more the longer the gap is.
  Eigen::Matrix3d Covariance() const {
    Eigen::MatrixXd across = Eigen::MatrixXd::Zero(right_.size(), 3);
    across.middleRows<3>(Position(gap_.last)).setIdentity();
    across.middleRows<3>(Position(gap_.first)) -= Eigen::Matrix3d::Identity();
    const Eigen::MatrixXd solved = factor_.solve(across);
    const Eigen::Matrix3d covariance = across.transpose() * solved;
    const double seconds = Seconds();
    const double by_tilt = kGravityMps2 * seconds * seconds / 4.0;
    return variance_factor_ * covariance +
           by_tilt * by_tilt * rotation_covariance_.trace() / 3.0 *
               Eigen::Matrix3d::Identity();
  }

  const std::vector<RelativePosePrior>& priors_;
  const std::vector<Model>& models_;
  const Chain& chain_;
  const Gap gap_;
  // Of the smoother.
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

void SetMotion(const MeasuredTranslation& measured, RelativePosePrior* prior) {
  prior->flags |= kPriorDirection | kPriorLength;
  SetTranslation(measured, prior);
}

MeasuredTranslation StepOfModel(const Rigid3d& cam1_from_world,
                                const Rigid3d& cam2_from_world,
                                double metres_per_unit) {
  MeasuredTranslation step;
  step.translation = metres_per_unit *
                     (cam2_from_world * cam1_from_world.Inverse()).translation;
  const double sigma = std::hypot(std::sqrt(2.0) * kPositionSigmaM,
                                  kStepSigmaRatio * step.translation.norm());
  step.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  return step;
}

class GapBridger {
 public:
  GapBridger(const std::vector<InertialMotion>& motions,
             const std::vector<RelativePosePrior>& priors,
             const std::vector<std::map<image_t, Rigid3d>>& models)
      : priors_(priors), chains_(FindChains(motions, priors)) {
    for (const std::map<image_t, Rigid3d>& model : models) {
      models_.push_back({model, EstimateInertialScale(motions, model)});
    }
    for (Chain& chain : chains_) LabelImages(models_, &chain);
  }

  InertialOdometry Bridge() {
    while (FindSize()) {
    }
    InertialOdometry odometry;
    odometry.priors = priors_;
    for (const Chain& chain : chains_) {
      AddSteps(chain, &odometry.priors);
      for (const Gap& gap : FindGaps(chain)) {
        if (HasScale(chain, gap.first) && HasScale(chain, gap.last)) {
          AddBridge(chain, gap, &odometry);
        }
      }
    }
    return odometry;
  }

 private:
  bool HasScale(const Chain& chain, size_t k) const {
    return models_[chain.models[k]].scale.has_value();
  }

  // Of a model across a gap from one whose size is known. False when there is
  // no such model any more.
  bool FindSize() {
    for (const Chain& chain : chains_) {
      for (const Gap& gap : FindGaps(chain)) {
        const bool is_far = HasScale(chain, gap.first);
        if (HasScale(chain, gap.last) == is_far) continue;
        GapSmoother smoother(priors_, models_, chain, gap);
        if (smoother.Seconds() > kMaxGapS || !smoother.Solve()) continue;
        const InertialScale scale = smoother.Scale(is_far);
        if (!(scale.metres_per_unit > 0.0) ||
            !(scale.sigma_ratio <= kMaxFoundSizeSigma)) {
          continue;
        }
        models_[chain.models[is_far ? gap.last : gap.first]].scale = scale;
        return true;
      }
    }
    return false;
  }

  // Within models.
  void AddSteps(const Chain& chain,
                std::vector<RelativePosePrior>* priors) const {
    for (size_t k = 0; k < chain.priors.size(); ++k) {
      if (chain.models[k] == kNoModel ||
          chain.models[k + 1] != chain.models[k]) {
        continue;
      }
      const Model& model = models_[chain.models[k]];
      if (!model.scale) continue;
      SetMotion(StepOfModel(model.cams_from_world.at(chain.images[k]),
                            model.cams_from_world.at(chain.images[k + 1]),
                            model.scale->metres_per_unit),
                &(*priors)[chain.priors[k]]);
    }
  }

  void AddBridge(const Chain& chain, const Gap& gap,
                 InertialOdometry* odometry) const {
    GapSmoother smoother(priors_, models_, chain, gap);
    if (smoother.Seconds() > kMaxGapS || !smoother.Solve()) return;
    size_t k = gap.first;
    for (const MeasuredTranslation& step : smoother.Steps()) {
      SetMotion(step, &odometry->priors[chain.priors[k]]);
      odometry->bridges[ImagePair(chain.images[k], chain.images[k + 1])] =
          step.covariance;
      ++k;
    }
    ++odometry->num_gaps;
  }

  const std::vector<RelativePosePrior>& priors_;
  std::vector<Chain> chains_;
  std::vector<Model> models_;
};

}  // namespace

InertialOdometry BridgeGaps(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::map<image_t, Rigid3d>>& models) {
  return GapBridger(motions, priors, models).Bridge();
}

}  // namespace adasfm
