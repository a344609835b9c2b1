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
#include "global/structure/tracks.h"
#include "global/structure/triangulate_tracks.h"

namespace adasfm {

struct CoarseStructureOptions {
  TrackOptions tracks;
  TrackTriangulationOptions triangulation;
  PriorBundleAdjustmentOptions bundle;
  // Vision that needs more than eight times its own noise to agree with the
  // sensors contradicts them, which is to be said (priors_agree).
  VarianceComponentOptions balance;
  // The rounds before the last see points in keyframes only.
  KeyframeOptions keyframes;
  // Motion straight ahead leaves some images without points of a wide angle.
  // Images with fewer points than this get those with the next smaller angles,
  int min_num_points_per_image = 40;
  // down to this one.
  double min_angle_floor_deg = 1.0;
  // Rounds of triangulation and adjustment; the largest reprojection error
  // shrinks from triangulation.max_reproj_error_px to this, or to what the
  // keypoints' noise asks for where that is more (MaxReprojErrorPx).
  int num_rounds = 3;
  double final_max_reproj_error_px = 4.0;
  // Relative change of the cost at which the rounds before the last end: their
  // points are dropped, so only the way matters, not the last digits.
  double early_function_tolerance = 1e-3;
  // Sensor priors take part in the adjustment.
  bool use_priors = true;
  // Focal lengths that the database does not mark as known are adjusted when
  // FindFocalLengthError finds them wrong, beside known ones that are held;
  // of wrong ones among those is only told.
  bool refine_unknown_focal_length = true;

  CoarseStructureOptions() { balance.max_sigma_factor = 8.0; }
  bool IsValid(std::string* error) const;
};

struct CoarseModelInput {
  // One component's poses; images without matches are welcome.
  std::map<image_t, Rigid3d> cams_from_world;
  // Whether their unit is the metre; otherwise the priors' lengths say nothing.
  bool metric = false;
  // Verified matches that the view graph kept, both images in the component.
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  // Those of images of other components are passed over.
  std::vector<RelativePosePrior> priors;
  // By which the cameras are turned against the scene's gravity directions;
  // the priors have it already.
  Eigen::Quaterniond camera_mount = Eigen::Quaterniond::Identity();
  // Pairs told focal lengths and distortions of lenses that nobody measured
  // (CalibrateFocalLengths), which the adjustment goes on with: points that
  // many images see tell them better, and so do the sensors' rotations. Lenses
  // that are known are held.
  bool refine_lenses = false;
};

struct CoarseModel {
  // Poses of all images of the component, points, and all of their keypoints.
  colmap::Reconstruction reconstruction;
  bool metric = false;
  // 1 sigma of the unit, as a ratio, where the accelerometer tells it; else 0.
  double inertial_scale_sigma = 0.0;
  // The world's z axis points up.
  bool gravity_aligned = false;
  // To the scene's positions; if it succeeded, the world is their frame.
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
  // Whether vision and the priors agree within what the balance may ask for.
  bool priors_agree = true;
  // FindFocalLengthError, of the focal lengths that the scene states: of the
  // unknown ones or, where these are right or refined with their distortion, of
  // the known ones.
  std::optional<FocalLengthError> focal_length_error;
  // The cameras are not the scene's any more.
  bool cameras_refined = false;
  // Smallest triangulation angle that had to be accepted.
  double min_angle_deg = 0.0;
  // Images with fewer points than asked for, in spite of that.
  int num_images_with_few_points = 0;
  int num_images_without_points = 0;
  // Of the verified pairs with the poses; measured by the stage.
  PairAgreement pair_agreement;
  // Of the refined pairs; found by the stage.
  std::optional<MapperStart> mapper_start;
  // One per round; the poses before a failed round are kept.
  std::vector<PriorBundleAdjustmentSummary> rounds;
};

// Step 2.7: tracks, points with an angle, and rounds of bundle adjustment with
// priors and tightening thresholds. Points start afresh from the adjusted poses
// in every round. With enough positions of GNSS, which then take part in the
// adjustments, the world is their frame. Otherwise the unit of the poses is
// kept, and the world is turned z-up when images know where the ground is.
CoarseModel BuildCoarseModel(
    const CoarseStructureOptions& options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    CoarseModelInput input);

}  // namespace adasfm
