// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/frames.h"
#include "core/camera_rig.h"
#include "core/inertial_motion.h"
#include "core/position_prior.h"
#include "core/prior_lengths.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

struct SceneImage {
  image_t image_id = kInvalidImageId;
  camera_t camera_id = 0;
  std::string name;
  // Pixels, COLMAP's convention: (0.5, 0.5) is the centre of the first pixel.
  std::vector<Eigen::Vector2d> keypoints;
  std::optional<timestamp_t> timestamp_ns;
  // Unit vector towards the ground, in the camera frame.
  std::optional<Eigen::Vector3d> gravity_in_cam;
  // As RelativePosePrior::drive (drives.h); -1: none.
  int drive = -1;
};

struct ScenePair {
  // image_id1 < image_id2; the indices of the matches are in the same order.
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  // COLMAP's TwoViewGeometry::ConfigurationType.
  int config = 0;
  std::vector<FeatureMatch> inlier_matches;
  // As stored, with unit translation; none when the row has no pose (COLMAP
  // then stores identity and zero).
  std::optional<Rigid3d> cam2_from_cam1;
  // As stored; none when the row has no matrix.
  std::optional<Eigen::Matrix3d> essential_matrix;
  // All matches before verification; filled only with read_raw_matches, and
  // empty when the database has none for the pair.
  std::vector<FeatureMatch> raw_matches;
};

// Everything that the stages need from a database, read once.
struct SceneData {
  std::map<camera_t, colmap::Camera> cameras;
  std::map<image_t, SceneImage> images;
  // Sorted by (image_id1, image_id2).
  std::vector<ScenePair> pairs;
  // Between consecutive images, sorted by time; between leaders where rigs have
  // frames. Empty without sensors.
  std::vector<RelativePosePrior> priors;
  // As in PriorTables; errors that the priors share.
  std::optional<Eigen::Matrix3d> gyroscope_bias_covariance;
  double length_drift_ratio = 0.0;
  std::optional<WheelScale> wheel_scale;
  // As in PriorTables, in the true camera frame. After adasfm_global, only
  // where wheels measured lengths or adasfm_global found metres by these
  // motions.
  std::vector<InertialMotion> inertial_motions;
  // The largest scale_sigma of the InertialLengths that adasfm_global added to
  // the priors; 0 without such lengths.
  double inertial_scale_sigma = 0.0;
  // Rigs of cameras, and their ComputeFramePriors.
  CameraRigs rigs;
  std::vector<RelativePosePrior> frame_priors;
  // Positions of GNSS or the like, in the ENU frame of the origin or, without
  // an origin, in a metric frame of their own.
  std::vector<PositionPrior> positions;
  std::optional<GeodeticPosition> position_origin;
  // Poses that the mapper does not change, in whose frame the coarse poses are.
  // Set for a model that is extended (existing_model.h).
  std::map<image_t, Rigid3d> fixed_poses;
  // For the user: what was skipped, and why.
  std::vector<std::string> warnings;
};

struct SceneDataOptions {
  bool read_raw_matches = false;
  // Use the two-view geometries, the priors and gravity as they were before
  // adasfm_global changed them.
  bool use_original_two_view_geometries = false;
  // Read times, priors, gravity and rigs of the images.
  bool read_priors = true;
  // Pairs with fewer inlier matches are skipped.
  int min_num_matches = 15;
};

// Reads a COLMAP database and its adasfm_ tables. An error for a missing file,
// a file that is not COLMAP's database, or rows that contradict each other. The
// database is not changed.
StatusOr<SceneData> ReadSceneData(const std::string& database_path,
                                  const SceneDataOptions& options);

// Frames and rigs for models of the scene (host/frames.h): the rigs of the
// scene, with the host's frames or, where the host has none, with frames of our
// own. Where the host's frames are not those of the scene's rigs, models get
// the host's frames, and `warnings` a message.
StatusOr<ModelFrames> ReadModelFrames(const std::string& database_path,
                                      const SceneData& scene,
                                      std::vector<std::string>* warnings);

}  // namespace adasfm
