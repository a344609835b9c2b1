// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/ceres.h>

#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/bundle_adjustment/shared_error_blocks.h"
#include "colmap_ext/cost_functions/adjusted_pose.h"
#include "colmap_ext/cost_functions/pose_prior_cost.h"
#include "colmap_ext/cost_functions/reprojection_cost.h"
#include "colmap_ext/cost_functions/rig_cost.h"
#include "colmap_ext/scene/covisibility.h"

namespace adasfm {

// The adjustment as a Ceres problem on copies of the poses, points and
// intrinsics that take part. Images are added in the order of ids, points in
// that of the first images that see them.
class BundleProblem final : private ceres::EvaluationCallback {
 public:
  // The options must be valid. Images without a residual do not take part, nor
  // do points in front of fewer than two cameras. Points and their observations
  // may be kept apart from the Ceres problem as long as the observations depend
  // on one pose alone: no intrinsics, no cams_from_rig. With `covisibility`
  // such a point becomes one for each group of its track's images that share
  // points.
  BundleProblem(const PriorBundleAdjustmentOptions& options,
                const PriorBundleAdjustmentProblem& problem,
                const colmap::Reconstruction& reconstruction,
                bool may_keep_points_apart = false,
                const Covisibility* covisibility = nullptr);
  BundleProblem(const BundleProblem&) = delete;
  BundleProblem& operator=(const BundleProblem&) = delete;

  // Images whose poses are adjusted.
  int NumImages() const { return num_adjusted_images_; }
  int NumPoints() const { return static_cast<int>(points_.size()); }
  int NumResiduals() const {
    return problem_->NumResiduals() +
           2 * static_cast<int>(observations_.size());
  }
  // The constant images that take part in a residual.
  std::vector<image_t> ConstantImages() const;

  // Makes the pose of the first image that has observations (else of the first
  // image) constant.
  void FixFirstPose();
  // Constrains the distance from the first constant pose to the farthest pose
  // that sees at least half as many points as the median image. sigma_ratio:
  // 1 sigma over that distance.
  void FixDistanceToFarthestPose(double sigma_ratio);

  // The pose of an image that already takes part in a residual; else null.
  const AdjustedPose* UsedPose(image_t image_id) const;
  bool IsConstant(image_t image_id) const;
  // The rotation error of T_cam_imu in a drive (shared_errors.h).
  double* ExtrinsicRotation(int drive) {
    return shared_errors_.ExtrinsicRotation(drive, problem_.get());
  }
  // Adds parameters with these values; returns their address.
  double* AddParameters(std::vector<double> values);
  // Adds a residual on poses of images and such parameters; takes ownership of
  // both functions.
  ceres::ResidualBlockId AddResidual(
      std::unique_ptr<ceres::CostFunction> cost,
      std::unique_ptr<ceres::LossFunction> loss,
      const std::vector<image_t>& image_ids,
      const std::vector<double*>& parameters = {});
  // The same for a prior term (kVelocity), with a Huber loss, which still
  // constrains large errors.
  void AddVelocityTerm(std::unique_ptr<ceres::CostFunction> cost,
                       const std::vector<image_t>& image_ids,
                       const std::vector<double*>& parameters);

  // The residual block of one term of a prior.
  struct PriorBlock {
    ceres::ResidualBlockId residual = nullptr;
    PriorTerm term = PriorTerm::kRotation;
    // Whether the factor of the term's sigma applies to it.
    bool has_factor = true;
    // Whether it has a robust loss.
    bool is_robust = true;
    // Whether keypoints test it (IsTestedMeasurement).
    bool is_tested = true;
  };
  // In the order in which they were added.
  const std::vector<PriorBlock>& PriorBlocks() const { return prior_blocks_; }
  bool IsPoint(const double* parameters) const;
  // Of images in order of their ids, then of frames added for rigs.
  std::vector<AdjustedPose>& Poses() { return poses_; }
  // Recomputes the poses from their present parameters.
  void UpdatePoses();

  // The points kept apart.
  size_t NumPointsApart() const { return points_apart_ ? points_.size() : 0; }
  Eigen::Vector3d& PointApart(size_t k) { return points_[k].xyz; }
  // The observations of a point, in order of image ids.
  struct ObservationRange {
    const PointObservation* first = nullptr;
    const PointObservation* last = nullptr;
    const PointObservation* begin() const { return first; }
    const PointObservation* end() const { return last; }
  };
  ObservationRange ObservationsOf(size_t k) const;
  // Null: plain squares.
  const ceres::LossFunction* ReprojectionLoss() const {
    return reprojection_loss_.get();
  }

  // Points are eliminated first.
  std::shared_ptr<ceres::ParameterBlockOrdering> Ordering();
  ceres::Problem* CeresProblem() { return problem_.get(); }
  bool IsFinite() const;
  SharedErrors EstimatedSharedErrors() const {
    return shared_errors_.Estimated();
  }
  void WriteTo(colmap::Reconstruction* reconstruction) const;

 private:
  // The poses of image and frame are in poses_, the cam_from_rig is in
  // cams_from_rig_.
  struct ImageBlock : RigPose {
    bool is_constant = false;
    int num_observations = 0;
    int num_priors = 0;
    bool IsUsed() const { return num_observations > 0 || num_priors > 0; }
    // What the solver changes: the image's own pose or that of its frame.
    AdjustedPose* SolvedPose() const { return IsDerived() ? frame : pose; }
  };
  struct PointBlock {
    colmap::point3D_t id = 0;  // Same for all groups of its track.
    Eigen::Vector3d xyz;
    size_t first_observation = 0;  // If kept apart.
  };
  struct CameraBlock {
    std::vector<double> params;
    bool is_constant = false;
    bool is_used = false;
  };
  struct Observation {
    image_t image_id = kInvalidImageId;
    Eigen::Vector2d xy;
    NormalizedKeypoint keypoint;
  };

  void PrepareForEvaluation(bool evaluate_jacobians,
                            bool new_evaluation_point) override;
  void AddImages(const PriorBundleAdjustmentProblem& problem,
                 const colmap::Reconstruction& reconstruction);
  // Gives the images of rigs their frames and cams_from_rig.
  void AddRigs(const CameraRigs& rigs,
               const colmap::Reconstruction& reconstruction);
  void AddRigPriors(const CameraRigs& rigs);
  // Adds a residual on the poses of images and on other parameters; `cost` is
  // owned by this object already.
  ceres::ResidualBlockId AddCost(ceres::CostFunction* cost,
                                 ceres::LossFunction* loss,
                                 const std::vector<const ImageBlock*>& images,
                                 const std::vector<double*>& others = {});
  void AddPoints(const colmap::Reconstruction& reconstruction,
                 const Covisibility* covisibility);
  // The position that fits all observations of the points from `begin` to
  // `end`, which are one point of the model.
  Eigen::Vector3d PositionOf(size_t begin, size_t end) const;
  double KeypointSigmaPx(camera_t camera_id) const;
  // Over the images in use.
  double MedianNumObservations() const;
  // The usable observations of a point, in order of image ids.
  std::vector<Observation> FindObservations(
      const colmap::Reconstruction& reconstruction,
      const colmap::Point3D& point) const;
  // The groups with two observations or more.
  static std::vector<std::vector<Observation>> CutTrack(
      const Covisibility& covisibility,
      const std::vector<Observation>& observations);
  void AddObservation(const colmap::Reconstruction& reconstruction,
                      const Observation& observation, PointBlock* point);
  void AddPriors(const std::vector<PosePriorEdge>& edges);
  ceres::ResidualBlockId AddPrior(const PosePriorEdge& edge,
                                  PosePriorCost::Term term, ImageBlock* image1,
                                  ImageBlock* image2,
                                  ceres::LossFunction* loss);
  void SetConstantBlocks(const colmap::Reconstruction& reconstruction);

  const PriorBundleAdjustmentOptions options_;
  std::map<image_t, ImageBlock> images_;
  std::map<camera_t, CameraBlock> cameras_;
  // Ceres orders the blocks of a group by address. Poses are contiguous and in
  // the order of ids, so that every run adds in the same order.
  std::vector<AdjustedPose> poses_;
  std::map<camera_t, AdjustedPose> cams_from_rig_;
  std::vector<PointBlock> points_;
  bool points_apart_ = false;
  std::vector<PointObservation> observations_;  // Of points kept apart.
  SharedErrorBlocks shared_errors_;
  std::deque<std::vector<double>> other_parameters_;
  std::deque<ReprojectionCost> reprojection_costs_;
  std::vector<std::unique_ptr<ceres::CostFunction>> other_costs_;
  std::vector<std::unique_ptr<ceres::LossFunction>> other_losses_;
  std::unique_ptr<ceres::LossFunction> reprojection_loss_;
  std::unique_ptr<ceres::LossFunction> prior_loss_;
  std::unique_ptr<ceres::Problem> problem_;
  std::vector<PriorBlock> prior_blocks_;
  int num_adjusted_images_ = 0;
};

}  // namespace adasfm
