// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "colmap_ext/evaluation/relative_pose_auc.h"
#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// cam_from_world by image name.
using NamedPoses = std::map<std::string, Rigid3d>;

struct GroundTruthOptions {
  // Times of the images, for a trajectory; when empty, the images' names are
  // times.
  std::string image_times_path;
  // Largest gap between poses of a trajectory for interpolation: over longer
  // gaps the truth would be a guess.
  double max_time_gap_s = 0.2;

  bool IsValid(std::string* error) const;
};

// Reads true poses: a COLMAP model; lines `name qw qx qy qz tx ty tz`
// (cam_from_world); or a TUM trajectory `t tx ty tz qx qy qz qw`
// (world_from_cam, in seconds or nanoseconds of the camera's clock), which is
// interpolated at the times of the images. image_names are those of the model;
// they are needed for trajectories without image times.
StatusOr<NamedPoses> ReadGroundTruth(
    const std::string& path, const std::vector<std::string>& image_names,
    const GroundTruthOptions& options);

// Errors after one alignment of the model's world to the true one.
struct AlignmentErrors {
  // Scale of the alignment: true metres per unit of the model.
  double scale = 1.0;
  double translation_rmse_m = 0.0;
  double translation_mean_m = 0.0;
  double translation_median_m = 0.0;
  double translation_max_m = 0.0;
  double rotation_mean_deg = 0.0;
  double rotation_median_deg = 0.0;
};

struct Evaluation {
  int num_models = 1;
  int num_images = 0;         // N_c
  int num_true_images = 0;    // in the ground truth
  int num_common_images = 0;  // in both
  int64_t num_points = 0;     // N_p
  double mean_track_length = 0.0;
  double rmse_px = 0.0;  // ComputeReprojectionRmse
  // The robust alignments are refitted to the images within three median
  // errors, so that a few wrong cameras do not dominate; the errors are those
  // of all images.
  AlignmentErrors sim3;
  AlignmentErrors sim3_least_squares;
  // With scale 1, for metric models.
  AlignmentErrors se3;
  AlignmentErrors se3_least_squares;
  // After the best robust rotation of the world to the orientations. The
  // alignments above fit the positions, which on a straight road do not
  // constrain the rotation about the road.
  double orientation_median_deg = 0.0;
  std::vector<RelativePoseAuc> relative_pose_auc;
};

// Compares the poses of the images in both sets. An error with fewer than three
// such images, or when all have the same position.
StatusOr<Evaluation> EvaluatePoses(const NamedPoses& cams_from_world,
                                   const NamedPoses& true_cams_from_world);

// The same, with figures of the model's points.
StatusOr<Evaluation> EvaluateModel(const colmap::Reconstruction& reconstruction,
                                   const NamedPoses& true_cams_from_world);

// Root of the mean squared point error, weighted by track length [px]. The
// error of a point is COLMAP's, the mean over its observations: the stored
// value, or computed where there is none. 0 without points.
double ComputeReprojectionRmse(const colmap::Reconstruction& reconstruction);

NamedPoses PosesOfModel(const colmap::Reconstruction& reconstruction);

std::string FormatEvaluation(const Evaluation& evaluation);
std::string EvaluationToJson(const Evaluation& evaluation);

}  // namespace adasfm
