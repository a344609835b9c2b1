// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/refine_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/bundle_adjustment/inertial_factors.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/part_adjuster.h"
#include "colmap_ext/mapper/prior_support.h"
#include "colmap_ext/mapper/register_image.h"
#include "colmap_ext/scene/georeference.h"
#include "colmap_ext/scene/untied_parts.h"
#include "core/disjoint_sets.h"
#include "core/prior_lengths.h"
#include "core/release_memory.h"

namespace adasfm {
namespace {

// Fewer points than this do not constrain an image by themselves.
constexpr size_t kMinNumPointsToHold = 20;
// Relative 1 sigma of the coarse motion's length for such images.
constexpr double kCoarseLengthSigmaRatio = 0.2;
constexpr size_t kMaxNumCoarseEdges = 4;

class ModelRefiner {
 public:
  ModelRefiner(const RefineModelOptions& options,
               const LocalMapperOptions& local, MapperScene* scene,
               RefineModelSummary* summary)
      : options_(options),
        local_(local),
        scene_(*scene),
        reconstruction_(scene->reconstruction),
        summary_(*summary) {
    for (const auto& [image_id, pose] : scene->data->fixed_poses) {
      if (scene->images.count(image_id) == 0) continue;
      if (IsRegistered(reconstruction_, image_id)) {
        SetCamFromWorld(pose, &reconstruction_.Image(image_id));
      } else {
        scene_.mapper.Register(image_id, pose);
      }
    }
  }

  void JoinParts() {
    if (!options_.join_parts) return;
    ReleaseMatches();
    AdjustTentatively();
    Filter(LoosePx());
  }

  void AdjustRoughly() {
    if (options_.join_parts) scene_.mapper.CompleteAndMergeTracks(LoosePx());
    TriangulateWeakImages();
    ReleaseMatches();
    AdjustTentatively();
    Filter(local_.filter_max_reproj_error_px);
    if (ResetContradictedImages()) AdjustTentatively();
  }

  void AdjustFinely() {
    scene_.mapper.CompleteAndMergeTracks(local_.filter_max_reproj_error_px);
    ReleaseMatches();
    summary_.keypoint_sigma_factor = 1.0;
    Adjust(1e-6, FindPriors(), &summary_.keypoint_sigma_factor);
    Filter(local_.filter_max_reproj_error_px);
    LeaveOutUnsupportedImages();
    LeaveOutUntiedParts();
  }

 private:
  bool IsFixed(image_t image_id) const {
    return scene_.data->fixed_poses.count(image_id) > 0;
  }

  // Adjustments take much memory of their own.
  void ReleaseMatches() {
    scene_.mapper.ReleaseMatches();
    ReleaseFreedMemory();
  }

  // Threshold until tracks of different parts are joined.
  double LoosePx() const { return 3.0 * local_.filter_max_reproj_error_px; }

  void Filter(double max_reproj_error_px) {
    scene_.mapper.FilterPoints(
        MaxReprojErrorPx(max_reproj_error_px, reconstruction_),
        local_.min_triangulation_angle_deg);
  }

  // COLMAP's Retriangulate, pair by pair, gives the same model but takes 5 %
  // more of the mapper's time on kitti07-160.
  void TriangulateWeakImages() {
    for (const image_t image_id : RegisteredImages(reconstruction_)) {
      const colmap::Image& image = reconstruction_.Image(image_id);
      if (2 * image.NumPoints3D() < image.NumPoints2D()) {
        scene_.mapper.TriangulateImage(image_id,
                                       local_.min_triangulation_angle_deg);
      }
    }
  }

  // Whether sensors measured the image's whole motion to another image of the
  // model.
  bool HasMotionPrior(image_t image_id) const {
    const auto indices = scene_.priors_of_image.find(image_id);
    if (indices == scene_.priors_of_image.end()) return false;
    return std::any_of(
        indices->second.begin(), indices->second.end(), [this](size_t i) {
          const RelativePosePrior& prior = scene_.priors[i];
          return prior.HasMotion() &&
                 IsRegistered(reconstruction_, prior.image_id1) &&
                 IsRegistered(reconstruction_, prior.image_id2);
        });
  }

  // Adds the coarse motions of images on few points to registered neighbours.
  void AddCoarseEdges(std::vector<PosePriorEdge>* edges) const {
    for (const image_t image_id : RegisteredImages(reconstruction_)) {
      if (reconstruction_.Image(image_id).NumPoints3D() >=
              kMinNumPointsToHold ||
          (local_.use_priors_in_adjustment && HasMotionPrior(image_id))) {
        continue;
      }
      size_t num_edges = 0;
      for (const auto& [neighbor, num_matches] :
           scene_.neighbors.at(image_id)) {
        if (!IsRegistered(reconstruction_, neighbor)) continue;
        std::optional<PosePriorEdge> edge =
            CoarseEdge(scene_, neighbor, image_id);
        if (!edge) continue;
        if (std::isfinite(edge->direction_sigma_rad)) {
          edge->length_sigma_m =
              kCoarseLengthSigmaRatio * edge->cam2_from_cam1.translation.norm();
          edge->is_length_measured = false;
        }
        edges->push_back(*edge);
        if (++num_edges == kMaxNumCoarseEdges) break;
      }
    }
  }

  void MarkPriorsInGaps(std::vector<PosePriorEdge>* edges) const {
    const auto is_held = [this](image_t image_id) {
      return reconstruction_.Image(image_id).NumPoints3D() >=
             kMinNumPointsToHold;
    };
    for (PosePriorEdge& edge : *edges) {
      edge.is_held_by_points =
          is_held(edge.image_id1) && is_held(edge.image_id2);
    }
  }

  std::vector<PosePriorEdge> FindPriors() const {
    if (!local_.use_priors_in_adjustment) return {};
    const std::set<image_t> images = RegisteredImages(reconstruction_);
    return FindPriorEdges(LeaveAccelerometerToFactors(FindInertialMotions(),
                                                      images, scene_.priors),
                          images);
  }

  // None in a model without metres, where the accelerometer does not help.
  std::vector<InertialMotion> FindInertialMotions() const {
    if (!local_.use_priors_in_adjustment || !HasLengths(scene_.priors)) {
      return {};
    }
    return scene_.data->inertial_motions;
  }

  // Until parts and gaps are in place, priors have residuals for other reasons
  // than keypoints or shared errors. The balance found then serves this
  // adjustment only, and shared errors are estimated in the last round.
  void AdjustTentatively() {
    std::vector<PosePriorEdge> priors = FindPriors();
    MarkPriorsInGaps(&priors);
    double keypoint_sigma_factor = summary_.keypoint_sigma_factor;
    Adjust(1e-3, std::move(priors), &keypoint_sigma_factor,
           /*is_tentative=*/true);
  }

  // Adjusts to its tolerance: an adjustment cut short leaves residuals of
  // priors that the balance would attribute to keypoints of too much weight.
  void Adjust(double function_tolerance, std::vector<PosePriorEdge> priors,
              double* keypoint_sigma_factor, bool is_tentative = false) {
    PriorBundleAdjustmentProblem problem;
    for (const image_t image_id : RegisteredImages(reconstruction_)) {
      (IsFixed(image_id) ? problem.constant_images : problem.images)
          .insert(image_id);
    }
    problem.priors = std::move(priors);
    AddCoarseEdges(&problem.priors);
    // Their residuals cannot change, and no keypoint is to blame for them.
    problem.priors.erase(
        std::remove_if(problem.priors.begin(), problem.priors.end(),
                       [this](const PosePriorEdge& edge) {
                         return IsFixed(edge.image_id1) &&
                                IsFixed(edge.image_id2);
                       }),
        problem.priors.end());
    // Frames of a rig become rigid once its parts and gaps are in place.
    if (!is_tentative && local_.use_priors_in_adjustment) {
      problem.rigs = scene_.data->rigs;
    }
    PriorBundleAdjustmentOptions options;
    options.keypoint_sigma_px = local_.keypoint_sigma_px;
    options.shared_errors.enabled = !is_tentative;
    options.shared_errors.length_drift_ratio = scene_.data->length_drift_ratio;
    if (is_tentative) {
      options.position_loss_scale = options_.initial_position_loss_scale;
    }
    AddPositions(&problem);
    problem.inertial_motions = FindInertialMotions();
    problem.constant_cameras = options_.constant_cameras;
    options.refine_focal_length = options_.refine_focal_length;
    options.refine_principal_point = options_.refine_principal_point;
    options.refine_extra_params = options_.refine_extra_params;
    options.function_tolerance = function_tolerance;
    options.num_threads = options_.num_threads;
    options.max_memory_gb = options_.max_memory_gb;
    VarianceComponentOptions balance = local_.balance;
    if (is_tentative) balance.estimate_keypoint_sigma = false;
    const PriorBundleAdjustmentSummary adjustment =
        AdjustBundleWithVarianceComponents(
            balance, options, problem, &reconstruction_, keypoint_sigma_factor);
    summary_.num_iterations += adjustment.num_iterations;
    summary_.min_num_shared_points = std::max(summary_.min_num_shared_points,
                                              adjustment.min_num_shared_points);
    summary_.keypoint_sigma_px = adjustment.keypoint_sigma_px;
    summary_.keypoint_sigma_ratios = adjustment.keypoint_sigma_ratios;
    summary_.prior_chi2_per_dof = adjustment.prior_chi2_per_dof;
    summary_.unit_sigma = adjustment.unit_sigma;
  }

  // The coarse model, and so this one, is in the frame of the positions.
  void AddPositions(PriorBundleAdjustmentProblem* problem) const {
    const SceneData& data = *scene_.data;
    if (data.positions.empty()) return;
    problem->positions = data.positions;
    Verticals verticals = FindVerticals(data, *scene_.coarse);
    problem->gravity_in_cam = std::move(verticals.gravity_in_cam);
    problem->gravity_sigma_rad = verticals.sigma_rad;
  }

  // The images whose usable priors are all violated.
  std::set<image_t> FindContradictedImages() const {
    std::set<image_t> contradicted;
    for (const auto& [image_id, indices] : scene_.priors_of_image) {
      int num_usable = 0;
      int num_contradicted = 0;
      for (const size_t i : indices) {
        const std::optional<bool> is_violated =
            IsViolated(scene_.priors[i], reconstruction_);
        num_usable += is_violated.has_value();
        num_contradicted += is_violated.value_or(false);
      }
      if (num_contradicted > 0 && num_contradicted == num_usable &&
          scene_.coarse->count(image_id) && !IsFixed(image_id)) {
        contradicted.insert(image_id);
      }
    }
    return contradicted;
  }

  bool ResetContradictedImages() {
    if (!local_.use_priors_in_adjustment) return false;
    const std::set<image_t> images = FindContradictedImages();
    for (const image_t image_id : images) {
      scene_.mapper.Deregister(image_id);
    }
    for (const image_t image_id : images) {
      const auto pose = ComputeGlobalCandidate(scene_, image_id);
      scene_.mapper.Register(image_id,
                             pose ? *pose : scene_.coarse->at(image_id));
    }
    summary_.num_images_reset = static_cast<int>(images.size());
    return !images.empty();
  }

  // A pose that neither points nor a chain of known motions from an image with
  // points confirms is only a guess of the coarse model.
  void LeaveOutUnsupportedImages() {
    const std::set<image_t> images = RegisteredImages(reconstruction_);
    std::map<image_t, int> index_of_image;
    for (const image_t image_id : images) {
      index_of_image.emplace(image_id, static_cast<int>(index_of_image.size()));
    }
    DisjointSets chains(images.size());
    const auto join = [&](image_t image_id1, image_t image_id2) {
      if (images.count(image_id1) == 0 || images.count(image_id2) == 0) return;
      chains.Join(index_of_image.at(image_id1), index_of_image.at(image_id2));
    };
    for (const RelativePosePrior& prior : scene_.priors) {
      if (prior.HasMotion()) join(prior.image_id1, prior.image_id2);
    }
    // Inertial factors over three images constrain those in between.
    for (const InertialMotion& motion : FindInertialMotions()) {
      join(motion.image_id1, motion.image_id2);
    }
    std::set<int> supported_chains;
    for (const image_t image_id : images) {
      if (reconstruction_.Image(image_id).NumPoints3D() >=
          kMinNumPointsOfPose) {
        supported_chains.insert(chains.Find(index_of_image.at(image_id)));
      }
    }
    for (const image_t image_id : images) {
      if (IsFixed(image_id) ||
          supported_chains.count(chains.Find(index_of_image.at(image_id)))) {
        continue;
      }
      scene_.mapper.Deregister(image_id);
      ++summary_.num_images_deregistered;
    }
  }

  // The poses of an untied part are correct only relative to each other.
  void LeaveOutUntiedParts() {
    if (!scene_.data->positions.empty()) return;
    for (const std::set<image_t>& part :
         FindUntiedParts(scene_.priors, reconstruction_)) {
      if (std::any_of(part.begin(), part.end(),
                      [this](image_t id) { return IsFixed(id); })) {
        continue;
      }
      for (const image_t image_id : part) {
        scene_.mapper.Deregister(image_id);
        ++summary_.num_images_deregistered;
      }
    }
  }

  const RefineModelOptions& options_;
  const LocalMapperOptions& local_;
  MapperScene& scene_;
  colmap::Reconstruction& reconstruction_;
  RefineModelSummary& summary_;
};

}  // namespace

void RefineModel(const RefineModelOptions& options,
                 const LocalMapperOptions& local, int round, MapperScene* scene,
                 RefineModelSummary* summary) {
  ModelRefiner refiner(options, local, scene, summary);
  switch (round) {
    case 1:
      return refiner.JoinParts();
    case 2:
      return refiner.AdjustRoughly();
    case kNumRefinementRounds:
      return refiner.AdjustFinely();
  }
  throw std::invalid_argument("RefineModel: no round " + std::to_string(round));
}

void RegisterAtCoarsePoses(MapperScene* scene) {
  for (const auto& [image_id, cam_from_world] : *scene->coarse) {
    if (scene->images.count(image_id) == 0) continue;
    scene->mapper.Register(image_id, cam_from_world);
  }
}

}  // namespace adasfm
