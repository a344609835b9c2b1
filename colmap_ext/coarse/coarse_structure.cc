// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/coarse_structure.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/coarse/select_coarse_points.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/align_to_gravity.h"
#include "colmap_ext/scene/georeference.h"
#include "colmap_ext/scene/scene_bearings.h"
#include "core/option_checker.h"

namespace adasfm {
namespace {

// Rounds of triangulation and adjustment: the first with a loose threshold,
// since the poses are coarse, the last with the final one.
constexpr int kNumRounds = 3;
// Smallest triangulation angle of points in images with few points, degrees.
constexpr double kMinAngleFloorDeg = 1.0;
// Relative change of the cost at which the rounds before the last end. Their
// points are discarded, so they need no last digits.
constexpr double kEarlyFunctionTolerance = 1e-3;

// Takes the cameras of the previous model, where it has them.
colmap::Reconstruction CreateReconstruction(
    const SceneData& scene, const std::map<image_t, Rigid3d>& cams_from_world,
    const colmap::Reconstruction& before) {
  colmap::Reconstruction reconstruction;
  for (const auto& [image_id, pose] : cams_from_world) {
    const SceneImage& scene_image = scene.images.at(image_id);
    if (!reconstruction.ExistsCamera(scene_image.camera_id)) {
      AddCamera(before.ExistsCamera(scene_image.camera_id)
                    ? before.Camera(scene_image.camera_id)
                    : scene.cameras.at(scene_image.camera_id),
                &reconstruction);
    }
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetName(scene_image.name);
    image.SetCameraId(scene_image.camera_id);
    image.SetPoints2D(scene_image.keypoints);
    AddRegisteredImage(std::move(image), pose, &reconstruction);
  }
  return reconstruction;
}

void AddPoints(const std::vector<TriangulatedTrack>& points,
               colmap::Reconstruction* reconstruction) {
  for (const TriangulatedTrack& point : points) {
    colmap::Track track;
    track.Reserve(point.track.size());
    for (const TrackElement& element : point.track) {
      track.AddElement(element.image_id, element.point2D_idx);
    }
    reconstruction->AddPoint3D(point.point_in_world, track);
  }
}

PriorBundleAdjustmentProblem CreateProblem(
    const CoarseStructureOptions& options, const SceneData& scene,
    const CoarseModelInput& input) {
  PriorBundleAdjustmentProblem problem;
  for (const auto& [image_id, pose] : input.cams_from_world) {
    problem.images.insert(image_id);
  }
  problem.priors = input.rest_pairs;
  if (!options.use_priors) return problem;
  std::vector<RelativePosePrior> priors = input.priors;
  priors.insert(priors.end(), scene.frame_priors.begin(),
                scene.frame_priors.end());
  for (const RelativePosePrior& prior : priors) {
    if (problem.images.count(prior.image_id1) == 0 ||
        problem.images.count(prior.image_id2) == 0) {
      continue;
    }
    PosePriorEdge edge = PosePriorEdgeFromPrior(prior);
    if (!input.metric) {
      edge.length_sigma_m = std::numeric_limits<double>::infinity();
      edge.translation_sigma_m = std::numeric_limits<double>::infinity();
    }
    problem.priors.push_back(edge);
  }
  return problem;
}

void FillFigures(CoarseModel* model) {
  const colmap::Reconstruction& reconstruction = model->reconstruction;
  model->num_points = reconstruction.NumPoints3D();
  model->num_observations = reconstruction.ComputeNumObservations();
  model->mean_reproj_error_px =
      model->num_points == 0 ? 0.0
                             : reconstruction.ComputeMeanReprojectionError();
  for (const image_t image_id : reconstruction.RegImageIds()) {
    const int num_points = reconstruction.Image(image_id).NumPoints3D();
    model->num_images_without_points += num_points == 0;
    model->num_images_with_few_points += num_points < kMinNumPointsPerImage;
  }
  model->prior_chi2_per_dof = model->rounds.back().prior_chi2_per_dof;
  model->priors_agree = model->rounds.back().priors_agree;
}

// Moves the poses into the frame of the positions, if they fit.
void AlignInput(const SceneData& scene, CoarseModelInput* input,
                PositionAlignment* alignment) {
  if (scene.positions.empty()) return;
  *alignment =
      AlignSceneToPositions(scene, input->cams_from_world, input->metric);
  if (!alignment->success) return;
  input->cams_from_world =
      TransformCamsFromWorld(alignment->enu_from_world, input->cams_from_world);
}

void AddPositions(const SceneData& scene, const CoarseModelInput& input,
                  PriorBundleAdjustmentProblem* problem) {
  problem->positions = scene.positions;
  Verticals verticals = FindVerticals(scene, input.cams_from_world);
  problem->gravity_in_cam = std::move(verticals.gravity_in_cam);
  problem->gravity_sigma_rad = verticals.sigma_rad;
}

// The threshold falls from round to round, geometrically; in the last one not
// below the noise of the previous model.
TrackTriangulationOptions TriangulationOptions(
    const CoarseStructureOptions& options, int round,
    const colmap::Reconstruction& before) {
  TrackTriangulationOptions triangulation = options.triangulation;
  triangulation.min_triangulation_angle_deg = std::min(
      kMinAngleFloorDeg, options.triangulation.min_triangulation_angle_deg);
  const double ratio =
      kFinalMaxReprojErrorPx / options.triangulation.max_reproj_error_px;
  const double progress = static_cast<double>(round) / (kNumRounds - 1);
  triangulation.max_reproj_error_px *= std::pow(ratio, progress);
  if (round + 1 == kNumRounds) {
    triangulation.max_reproj_error_px =
        MaxReprojErrorPx(kFinalMaxReprojErrorPx, before);
  }
  return triangulation;
}

struct RoundTracks {
  std::vector<Track> all;
  // For the rounds before the last, unless all images are keyframes.
  std::vector<Track> within_keyframes;
  bool has_keyframes = false;
  size_t num_keyframes = 0;

  const std::vector<Track>& Of(bool is_last_round) const {
    return has_keyframes && !is_last_round ? within_keyframes : all;
  }
};

RoundTracks BuildRoundTracks(const CoarseStructureOptions& options,
                             const CoarseModelInput& input,
                             const std::set<image_t>& images,
                             size_t min_num_images_for_keyframes) {
  std::vector<Track> joined = BuildTracks(input.matches);
  const bool has_metres = input.metric && options.use_priors;
  const std::set<image_t> keyframes =
      has_metres ? SelectKeyframes(images, joined, input.priors,
                                   min_num_images_for_keyframes)
                 : images;
  RoundTracks tracks;
  tracks.num_keyframes = keyframes.size();
  tracks.has_keyframes = keyframes.size() < images.size();
  if (tracks.has_keyframes) {
    tracks.within_keyframes = SelectTracks(options.max_track_length,
                                           RestrictTracks(joined, keyframes));
  }
  tracks.all = SelectTracks(options.max_track_length, std::move(joined));
  return tracks;
}

// The model of a round before its adjustment: the poses (and cameras) so far,
// and points triangulated afresh from them.
void BuildRound(const CoarseStructureOptions& options, const SceneData& scene,
                const std::map<image_t, std::vector<Bearing>>& bearings,
                const CoarseModelInput& input, const RoundTracks& tracks,
                int round, CoarseModel* model) {
  const bool is_first = round == 0;
  const std::map<image_t, Rigid3d> cams_from_world =
      is_first ? input.cams_from_world : CamsFromWorld(model->reconstruction);
  std::map<image_t, std::vector<Bearing>> refined;
  if (!is_first && options.bundle.RefinesCameras()) {
    refined = ComputeModelBearings(model->reconstruction,
                                   options.triangulation.num_threads);
  }
  std::vector<TriangulatedTrack> points = TriangulateTracks(
      TriangulationOptions(options, round, model->reconstruction),
      cams_from_world, refined.empty() ? bearings : refined,
      tracks.Of(round + 1 == kNumRounds));
  model->reconstruction =
      CreateReconstruction(scene, cams_from_world, model->reconstruction);
  AddPoints(
      SelectCoarsePoints(options, std::move(points), &model->min_angle_deg),
      &model->reconstruction);
}

// The noise of keypoints and its balance with the priors are meaningful near
// the optimum only, so the last round estimates them.
PriorBundleAdjustmentSummary AdjustRound(
    const CoarseStructureOptions& options,
    const PriorBundleAdjustmentProblem& problem, int round,
    const PositionAlignment& alignment, colmap::Reconstruction* reconstruction,
    double* keypoint_sigma_factor) {
  PriorBundleAdjustmentOptions bundle = options.bundle;
  bundle.position_loss_scale = PositionLossScale(
      alignment, bundle.position_loss_scale, round, kNumRounds);
  VarianceComponentOptions balance = options.balance;
  balance.estimate_prior_sigmas = false;
  if (round + 1 < kNumRounds) {
    bundle.function_tolerance =
        std::max(bundle.function_tolerance, kEarlyFunctionTolerance);
    balance.enabled = false;
    balance.estimate_keypoint_sigma = false;
  }
  return AdjustBundleWithVarianceComponents(
      balance, bundle, problem, reconstruction, keypoint_sigma_factor);
}

std::set<camera_t> FindCameras(const colmap::Reconstruction& reconstruction,
                               bool has_known_focal_length) {
  std::set<camera_t> camera_ids;
  for (const auto& [camera_id, camera] : reconstruction.Cameras()) {
    if (HasPriorFocalLength(camera) == has_known_focal_length) {
      camera_ids.insert(camera_id);
    }
  }
  return camera_ids;
}

// Repeats the last round after an adjustment of the focal lengths and, with
// refine_lenses, of the distortion.
void RepeatWithFreeLenses(
    CoarseStructureOptions options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const CoarseModelInput& input, const RoundTracks& tracks,
    const PriorBundleAdjustmentProblem& problem, double* keypoint_sigma_factor,
    CoarseModel* model) {
  const int last = kNumRounds - 1;
  options.bundle.refine_focal_length = true;
  options.bundle.refine_extra_params = input.refine_lenses;
  *keypoint_sigma_factor = 1.0;
  model->cameras_refined = true;
  model->rounds.push_back(AdjustRound(options, problem, last, model->positions,
                                      &model->reconstruction,
                                      keypoint_sigma_factor));
  BuildRound(options, scene, bearings, input, tracks, last, model);
  model->rounds.push_back(AdjustRound(options, problem, last, model->positions,
                                      &model->reconstruction,
                                      keypoint_sigma_factor));
}

// Refines unknown lenses where they are wrong, with the known ones held. Then
// tests the known ones, whose errors are only reported.
void AdjustLenses(const CoarseStructureOptions& options, const SceneData& scene,
                  const std::map<image_t, std::vector<Bearing>>& bearings,
                  const CoarseModelInput& input, const RoundTracks& tracks,
                  PriorBundleAdjustmentProblem problem,
                  double* keypoint_sigma_factor, CoarseModel* model) {
  const std::set<camera_t> known = FindCameras(model->reconstruction, true);
  const std::set<camera_t> unknown = FindCameras(model->reconstruction, false);
  const auto find_error = [&] {
    model->focal_length_error =
        FindFocalLengthError(options.bundle, problem, model->reconstruction);
    return model->focal_length_error.has_value();
  };
  if (!unknown.empty()) {
    problem.constant_cameras = known;
    if (input.refine_lenses ||
        (find_error() && options.refine_unknown_focal_length)) {
      RepeatWithFreeLenses(options, scene, bearings, input, tracks, problem,
                           keypoint_sigma_factor, model);
    }
  }
  if (known.empty() || model->focal_length_error) return;
  problem.constant_cameras = unknown;
  find_error();
}

}  // namespace

bool CoarseStructureOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
             .AtLeast(3, "max_track_length", max_track_length)
             .AllHold() &&
         triangulation.IsValid(error) && bundle.IsValid(error);
}

CoarseModel BuildCoarseModel(
    const CoarseStructureOptions& options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    CoarseModelInput input, size_t min_num_images_for_keyframes) {
  CoarseModel model;
  AlignInput(scene, &input, &model.positions);
  const bool is_georeferenced = model.positions.success;
  model.metric = input.metric || is_georeferenced;
  model.max_track_bytes = EstimateTrackBytes(input.matches);
  PriorBundleAdjustmentProblem problem = CreateProblem(options, scene, input);
  if (is_georeferenced) AddPositions(scene, input, &problem);
  const RoundTracks tracks = BuildRoundTracks(options, input, problem.images,
                                              min_num_images_for_keyframes);
  input.matches.clear();  // The tracks have them.
  model.num_tracks = tracks.all.size();
  model.num_keyframes = tracks.num_keyframes;

  double keypoint_sigma_factor = 1.0;
  for (int round = 0; round < kNumRounds; ++round) {
    BuildRound(options, scene, bearings, input, tracks, round, &model);
    model.rounds.push_back(AdjustRound(options, problem, round, model.positions,
                                       &model.reconstruction,
                                       &keypoint_sigma_factor));
    if (!model.rounds.back().success) break;
  }
  model.cameras_refined = options.bundle.RefinesCameras();
  if (model.rounds.back().success && !model.cameras_refined) {
    AdjustLenses(options, scene, bearings, input, tracks, problem,
                 &keypoint_sigma_factor, &model);
  }
  FilterPoints(MaxReprojErrorPx(kFinalMaxReprojErrorPx, model.reconstruction),
               std::min(kMinAngleFloorDeg,
                        options.triangulation.min_triangulation_angle_deg),
               &model.reconstruction);
  model.gravity_aligned =
      is_georeferenced || AlignToGravity(scene, &model.reconstruction);
  model.keypoint_sigma_px = model.rounds.back().keypoint_sigma_px;
  FillFigures(&model);
  return model;
}

}  // namespace adasfm
