// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"
#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/coarse/find_focal_length_error.h"
#include "colmap_ext/coarse/mapper_start.h"
#include "colmap_ext/coarse/pair_agreement.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/scene/align_to_positions.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/rigid3d.h"
#include "global/structure/select_keyframes.h"
#include "global/structure/triangulate_tracks.h"
#include "global/view_graph/tracks.h"

namespace adasfm {

// Largest reprojection error in the last round of triangulation and adjustment,
// px. The rounds before begin at triangulation.max_reproj_error_px. Where the
// limit by the keypoints' noise (MaxReprojErrorPx) is more, it counts.
inline constexpr double kFinalMaxReprojErrorPx = 4.0;

struct CoarseStructureOptions {
  // Longer tracks keep this many images, spread evenly from the first to the
  // last: the adjustment's cost grows with the square of a track's length, and
  // many short tracks constrain an image as well as few long ones.
  int max_track_length = 12;
  TrackTriangulationOptions triangulation;
  PriorBundleAdjustmentOptions bundle;
  // Its max_sigma_factor is 8: vision that needs more than eight times its own
  // noise to agree with the sensors contradicts them, as priors_agree reports.
  VarianceComponentOptions balance;
  // Sensor priors take part in the adjustment.
  bool use_priors = true;
  // Focal lengths that the database does not mark as known are adjusted when
  // FindFocalLengthError finds them wrong. Known ones are held, and their
  // errors are only reported.
  bool refine_unknown_focal_length = true;

  CoarseStructureOptions() { balance.max_sigma_factor = 8.0; }
  bool IsValid(std::string* error) const;
};

struct CoarseModelInput {
  // Poses of one component; images without matches are allowed.
  std::map<image_t, Rigid3d> cams_from_world;
  // Whether their unit is the metre; otherwise lengths of priors are not used.
  bool metric = false;
  // Verified matches that the view graph kept, both images in the component.
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  // Priors on images of other components are ignored.
  std::vector<RelativePosePrior> priors;
  // Pairs of a camera at rest (ViewGraphEdge::IsJoinAtRest), in the unit of the
  // poses. Among hundreds of images of one place, some see hardly any of the
  // points.
  std::vector<PosePriorEdge> rest_pairs;
  // Whether pairs determined focal lengths and distortions of unknown lenses
  // (CalibrateFocalLengths). The adjustment then refines them, since points in
  // many images determine them better, and so do the sensors' rotations. Known
  // lenses are held.
  bool refine_lenses = false;
};

struct CoarseModel {
  // Poses of all images of the component, points, and all of their keypoints.
  colmap::Reconstruction reconstruction;
  bool metric = false;
  // Relative 1 sigma of the unit, where the accelerometer set it; else 0.
  double inertial_scale_sigma = 0.0;
  // The world's z axis points up.
  bool gravity_aligned = false;
  // Alignment to the scene's positions; on success the world is their frame.
  PositionAlignment positions;
  size_t num_tracks = 0;
  // Images that see points in the rounds before the last.
  size_t num_keyframes = 0;
  // EstimateTrackBytes of the matches.
  size_t max_track_bytes = 0;
  size_t num_points = 0;
  size_t num_observations = 0;
  double mean_reproj_error_px = 0.0;
  // As in RefineModelSummary.
  double keypoint_sigma_px = 0.0;
  double prior_chi2_per_dof = 0.0;
  // Whether vision and the priors agree within the limits of the balance.
  bool priors_agree = true;
  // Result of FindFocalLengthError on the focal lengths that the scene states:
  // the unknown ones or, where these are right or refined with their
  // distortion, the known ones.
  std::optional<FocalLengthError> focal_length_error;
  // Whether the cameras differ from the scene's.
  bool cameras_refined = false;
  // Smallest triangulation angle that had to be accepted.
  double min_angle_deg = 0.0;
  // Images with fewer points than asked for, in spite of that.
  int num_images_with_few_points = 0;
  int num_images_without_points = 0;
  // Agreement of the verified pairs with the poses; set by the stage.
  PairAgreement pair_agreement;
  // Best one of the refined pairs; set by the stage.
  std::optional<MapperStart> mapper_start;
  // One per round; the poses before a failed round are kept.
  std::vector<PriorBundleAdjustmentSummary> rounds;
};

// Step 2.7: tracks, points with an angle, and rounds of bundle adjustment with
// priors and tightening thresholds. Every round triangulates points anew from
// the adjusted poses. The rounds before the last use points in keyframes only
// (SelectKeyframes), in components of at least min_num_images_for_keyframes.
// With enough GNSS positions, which then take part in the adjustments, the
// world is their frame. Otherwise the unit of the poses is kept, and the world
// is rotated z-up when images have gravity directions.
CoarseModel BuildCoarseModel(
    const CoarseStructureOptions& options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    CoarseModelInput input,
    size_t min_num_images_for_keyframes = kMinNumImagesForKeyframes);

}  // namespace adasfm
