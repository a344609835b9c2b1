// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/local_mapper.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/part_adjuster.h"
#include "colmap_ext/mapper/prior_support.h"
#include "core/interruption.h"
#include "core/option_checker.h"

namespace adasfm {
namespace {

// An initial pair with fewer triangulated points is rejected for the next one.
constexpr size_t kMinNumInitialPoints = 15;
constexpr size_t kMaxNumInitialTrials = 5;
// A batch larger than this share of the model would rest on points that no
// adjustment has seen.
constexpr double kMaxBatchRatio = 0.5;
constexpr size_t kMinBatchSize = 8;
// The whole part is adjusted when it has grown by this factor since the last
// time. The coarse poses keep drift small in between, so this is seldom
// (COLMAP: 1.1 and every 500 images).
constexpr double kGlobalAdjustmentGrowth = 1.5;

class LocalMapper {
 public:
  LocalMapper(const LocalMapperOptions& options, const SceneData& data,
              const CoarsePoseMap& coarse, const std::set<image_t>& images)
      : options_(options),
        scene_(BuildMapperScene(data, coarse, images)),
        reconstruction_(scene_->reconstruction),
        adjuster_(options, scene_.get()) {}

  LocalMapResult Run() {
    while (RegisterInitialPair()) {  // 1
      while (RegisterBatch()) {      // 2
        AdjustAsGrown();             // 3
        ThrowIfInterrupted();
      }
      num_registered_at_adjustment_ = 0;
    }  // 4
    if (reconstruction_.NumRegImages() == 0) {
      throw std::runtime_error("no initial pair among the part's images");
    }
    RegisterByPriors();  // 5
    Finish();            // 6
    scene_->mapper.End();
    result_.num_global_adjustments = adjuster_.NumGlobalAdjustments();
    result_.keypoint_sigma_factor = adjuster_.KeypointSigmaFactor();
    result_.mean_reproj_error_px =
        reconstruction_.ComputeMeanReprojectionError();
    result_.reconstruction = std::move(reconstruction_);
    return std::move(result_);
  }

 private:
  void Triangulate(image_t image_id) {
    scene_->mapper.TriangulateImage(image_id,
                                    options_.min_triangulation_angle_deg);
  }

  bool RegisterInitialPair() {
    for (const InitialPair& pair :
         FindInitialPairs(options_.initial_max_epipolar_error_px, *scene_,
                          kMaxNumInitialTrials)) {
      const Rigid3d local_from_coarse = FindLocalFromCoarse(pair.image_id1);
      scene_->mapper.Register(
          pair.image_id1, pair.cam1_from_world * local_from_coarse.Inverse());
      scene_->mapper.Register(
          pair.image_id2, pair.cam2_from_world * local_from_coarse.Inverse());
      Triangulate(pair.image_id1);
      adjuster_.AdjustPair(pair.image_id1, pair.image_id2);
      if (reconstruction_.Image(pair.image_id1).NumPoints3D() >=
          kMinNumInitialPoints) {
        return true;
      }
      scene_->mapper.Deregister(pair.image_id2);
      scene_->mapper.Deregister(pair.image_id1);
    }
    return false;
  }

  // Local frame from coarse frame near an image that begins a new piece: at the
  // registered image with the nearest coarse position; identity without any.
  Rigid3d FindLocalFromCoarse(image_t image_id) const {
    const Eigen::Vector3d center =
        scene_->coarse->at(image_id).TargetOriginInSource();
    double best_distance = 0.0;
    image_t nearest = kInvalidImageId;
    for (const image_t other : RegisteredImages(reconstruction_)) {
      const auto coarse = scene_->coarse->find(other);
      if (coarse == scene_->coarse->end()) continue;
      const double distance =
          (coarse->second.TargetOriginInSource() - center).norm();
      if (nearest == kInvalidImageId || distance < best_distance) {
        best_distance = distance;
        nearest = other;
      }
    }
    if (nearest == kInvalidImageId) return Rigid3d();
    return CamFromWorld(reconstruction_.Image(nearest)).Inverse() *
           scene_->coarse->at(nearest);
  }

  // Registers images that see v_p points, most points first. An image that
  // failed is tried again only when it sees 1.2 times as many points. False
  // when no image could be registered.
  bool RegisterBatch() {
    const size_t max_size = std::max(
        kMinBatchSize,
        static_cast<size_t>(kMaxBatchRatio * reconstruction_.NumRegImages()));
    batch_.clear();
    for (const image_t image_id : scene_->mapper.FindNextImages(
             options_.registration.min_num_visible_points)) {
      if (batch_.size() == max_size) break;
      const size_t num_visible = scene_->mapper.NumVisiblePoints(image_id);
      size_t& num_visible_at_failure = num_visible_at_failure_[image_id];
      if (num_visible < 1.2 * num_visible_at_failure) continue;
      const RegisteredBy registered_by =
          RegisterImage(options_.registration, image_id, scene_.get());
      if (registered_by == RegisteredBy::kNone) {
        num_visible_at_failure = num_visible;
        continue;
      }
      result_.num_registered_by_global_pose +=
          registered_by == RegisteredBy::kGlobalPose;
      Triangulate(image_id);
      batch_.insert(image_id);
    }
    return !batch_.empty();
  }

  void AdjustAsGrown() {
    if (reconstruction_.NumRegImages() >=
        kGlobalAdjustmentGrowth * num_registered_at_adjustment_) {
      adjuster_.AdjustAll(10);
      num_registered_at_adjustment_ = reconstruction_.NumRegImages();
    } else {
      adjuster_.AdjustBatch(batch_);
    }
  }

  // Breadth first from the registered images along priors that confirm the
  // coarse motion.
  void RegisterByPriors() {
    bool grew = true;
    while (grew) {
      grew = false;
      for (const image_t image_id : scene_->images) {
        if (IsRegistered(reconstruction_, image_id) ||
            !HasConfirmedNeighbor(image_id)) {
          continue;
        }
        const auto pose = ComputeGlobalCandidate(*scene_, image_id);
        if (!pose) continue;
        scene_->mapper.Register(image_id, *pose);
        result_.prior_only_images.insert(image_id);
        grew = true;
      }
    }
  }

  // Whether a registered image is tied to this one by a prior that agrees with
  // the coarse motion between the two.
  bool HasConfirmedNeighbor(image_t image_id) const {
    const auto indices = scene_->priors_of_image.find(image_id);
    if (indices == scene_->priors_of_image.end()) return false;
    for (const size_t i : indices->second) {
      const RelativePosePrior& prior = scene_->priors[i];
      const image_t other =
          prior.image_id1 == image_id ? prior.image_id2 : prior.image_id1;
      const auto coarse1 = scene_->coarse->find(prior.image_id1);
      const auto coarse2 = scene_->coarse->find(prior.image_id2);
      if (IsRegistered(reconstruction_, other) &&
          coarse1 != scene_->coarse->end() &&
          coarse2 != scene_->coarse->end() &&
          IsSupportedByPrior(
              prior, ComputeCam2FromCam1(coarse1->second, coarse2->second))) {
        return true;
      }
    }
    return false;
  }

  void Finish() {
    adjuster_.AdjustAll(15);
    // Retriangulate takes only pairs that share few points: 12,218 points in
    // place of 12,429 on kitti01-51.
    for (const image_t image_id : RegisteredImages(reconstruction_))
      Triangulate(image_id);
    adjuster_.AdjustAll(15);
    for (auto it = result_.prior_only_images.begin();
         it != result_.prior_only_images.end();) {
      // The image has enough points by now.
      const int num_points = reconstruction_.Image(*it).NumPoints3D();
      const bool has_points =
          num_points >= options_.registration.min_num_visible_points;
      it = has_points ? result_.prior_only_images.erase(it) : std::next(it);
    }
  }

  const LocalMapperOptions& options_;
  std::unique_ptr<MapperScene> scene_;
  colmap::Reconstruction& reconstruction_;
  PartAdjuster adjuster_;
  std::set<image_t> batch_;
  std::map<image_t, size_t> num_visible_at_failure_;
  size_t num_registered_at_adjustment_ = 0;
  LocalMapResult result_;
};

}  // namespace

bool LocalMapperOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmMapper", error)
      .AtLeast(4, "min_num_visible_points", registration.min_num_visible_points)
      .Positive("max_reproj_error_px", registration.max_reproj_error_px)
      .Positive("filter_max_reproj_error_px", filter_max_reproj_error_px)
      .Positive("min_triangulation_angle_deg", min_triangulation_angle_deg)
      .Positive("keypoint_sigma_px", keypoint_sigma_px)
      .AllHold();
}

LocalMapResult ReconstructLocally(const LocalMapperOptions& options,
                                  const SceneData& data,
                                  const CoarsePoseMap& coarse,
                                  const std::set<image_t>& images) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  return LocalMapper(options, data, coarse, images).Run();
}

}  // namespace adasfm
