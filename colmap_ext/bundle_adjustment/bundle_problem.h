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
  // The options are valid. Images without a residual do not take part, nor do
  // points behind all but one of their cameras. Points may be kept apart from
  // the Ceres problem, which then has neither them nor their observations, as
  // long as these depend on one pose alone: no intrinsics, no mounts. With
  // `covisibility` such a point becomes one for each group of its track's
  // images that share points.
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
  // Those that take part in a residual.
  std::vector<image_t> ConstantImages() const;

  // Makes the pose of the first image that has observations (else of the first
  // image) constant.
  void FixFirstPose();
  // Holds the distance from the first constant pose to the pose farthest from
  // it that sees at least half as many points as the median image, to this
  // share of the distance.
  void FixDistanceToFarthestPose(double sigma_ratio);

  // The pose of an image that has part in a residual already; null for others.
  const AdjustedPose* UsedPose(image_t image_id) const;
  bool IsConstant(image_t image_id) const;
  // The rotation by which T_cam_imu is wrong (shared_errors.h).
  double* ExtrinsicRotation() {
    return shared_errors_.ExtrinsicRotation(problem_.get());
  }
  // Parameters of the caller's own.
  double* AddParameters(std::vector<double> values);
  // Adds a residual on such poses and parameters and takes both over.
  ceres::ResidualBlockId AddResidual(
      std::unique_ptr<ceres::CostFunction> cost,
      std::unique_ptr<ceres::LossFunction> loss,
      const std::vector<image_t>& image_ids,
      const std::vector<double*>& parameters = {});
  // The same for a term of priors, with a Huber loss: it pulls at what is far
  // off, too.
  void AddVelocityTerm(std::unique_ptr<ceres::CostFunction> cost,
                       const std::vector<image_t>& image_ids,
                       const std::vector<double*>& parameters);

  // The residual block of one term of a prior.
  struct PriorBlock {
    ceres::ResidualBlockId residual = nullptr;
    PriorTerm term = PriorTerm::kRotation;
    // Whether the term's factor of the sigmas counts for it,
    bool has_factor = true;
    // it has a robust loss,
    bool is_robust = true;
    // and keypoints test it (IsTestedMeasurement).
    bool is_tested = true;
  };
  // In the order in which they were added.
  const std::vector<PriorBlock>& PriorBlocks() const { return prior_blocks_; }
  bool IsPoint(const double* parameters) const;
  // In order of image ids.
  std::vector<AdjustedPose>& Poses() { return poses_; }
  // To the parameters as they are.
  void UpdatePoses();

  // Of those kept apart.
  size_t NumPointsApart() const { return points_apart_ ? points_.size() : 0; }
  Eigen::Vector3d& PointApart(size_t k) { return points_[k].xyz; }
  // In order of image ids.
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
  // Its pose, and the frame's, are in poses_, its mount in mounts_.
  struct ImageBlock : RigPose {
    bool is_constant = false;
    int num_observations = 0;
    int num_priors = 0;
    bool IsUsed() const { return num_observations > 0 || num_priors > 0; }
    // What the solver changes: the image's own pose or that of its frame.
    AdjustedPose* SolvedPose() const { return IsDerived() ? frame : pose; }
  };
  struct PointBlock {
    colmap::point3D_t id = 0;  // Of all groups of its track.
    Eigen::Vector3d xyz;
    size_t first_observation = 0;  // Where they are kept apart.
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
  // Gives the images of rigs their frames and mounts.
  void AddRigs(const CameraRigs& rigs,
               const colmap::Reconstruction& reconstruction);
  void AddMountPriors(const CameraRigs& rigs);
  // Adds a residual on the poses of images and on other parameters; `cost` is
  // owned by this object already.
  ceres::ResidualBlockId AddCost(ceres::CostFunction* cost,
                                 ceres::LossFunction* loss,
                                 const std::vector<const ImageBlock*>& images,
                                 const std::vector<double*>& others = {});
  void AddPoints(const colmap::Reconstruction& reconstruction,
                 const Covisibility* covisibility);
  // Where all observations of the points from `begin` to `end`, which are one
  // in the model, see it.
  Eigen::Vector3d PositionOf(size_t begin, size_t end) const;
  double KeypointSigmaPx(camera_t camera_id) const;
  // Of the images in use.
  double MedianNumObservations() const;
  // The usable observations of a point, in order of image ids.
  std::vector<Observation> FindObservations(
      const colmap::Reconstruction& reconstruction,
      const colmap::Point3D& point) const;
  // The groups of two observations or more.
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
  // Ceres orders the blocks of a group by address: contiguous and in the order
  // of ids, so that every run adds in the same order.
  std::vector<AdjustedPose> poses_;
  std::map<camera_t, AdjustedPose> mounts_;
  std::vector<PointBlock> points_;
  bool points_apart_ = false;
  std::vector<PointObservation> observations_;  // Kept apart.
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
