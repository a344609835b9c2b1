// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// Features and matches by the host's own classes, into a database of its own
// making; with the environment variable ADASFM_HOST_COLMAP by that program
// instead (host_features.h). Work that is in the database already is not done
// again, so that an interrupted run continues. Interruption
// (core/interruption.h) by the progress callback leaves the database whole.

struct FeatureOptions {
  std::string camera_model = "SIMPLE_RADIAL";
  // Comma-separated, in the model's order; empty: from EXIF, else 1.2 times the
  // longer side as focal length.
  std::string camera_params;
  // Of the photos that the parameters are of; 0: not known.
  int camera_width_px = 0;
  int camera_height_px = 0;
  // 1: all photos are of one camera; 0: each of its own; 2: those of equal size
  // in a folder share one, as with a lens a folder; -1: photos of equal size
  // and equal first parameters share one.
  int single_camera = -1;
  // Larger photos are scaled down for the detector.
  int max_image_size = 2000;
  // The largest ones. Matching grows with its square, the points of the model
  // with it; poses need few hundred (docs/results/matching.md).
  int max_num_features = 2048;
  // "colmap": the host's SIFT; "opencv": OpenCV's on the CPU, with the host's
  // settings in a third of its time (features/sift_features.h).
  std::string extractor = "colmap";
  // -1: SIFT begins with the photo at twice its size, as COLMAP does; 0: as it
  // is, which takes a quarter of the time and finds fewer and larger features.
  int first_octave = -1;
  // 1, 0, or -1: when the host was built with CUDA and a device is there.
  int use_gpu = -1;
  // "adasfm": all descriptors are compared (match_sift_pairs.h), or "host":
  // COLMAP's matcher, which also is what a GPU and the program of
  // ADASFM_HOST_COLMAP match with.
  std::string matcher = "adasfm";
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct ImageRegistration {
  int num_images = 0;
  int num_cameras = 0;
  // With a focal length from EXIF or from the options.
  int num_known_focal_lengths = 0;
  // Files that the host cannot read as images.
  std::vector<std::string> unreadable;
};

// Whether SIFT runs on the GPU with these options.
bool UsesGpu(const FeatureOptions& options);
// An error when they demand a GPU that the host cannot use.
Status CheckGpu(const FeatureOptions& options);

// Creates the database when needed and writes cameras and images, the ids in
// the order of `names` (relative to image_path). Reading the photos is most of
// the work. An error for photos of different sizes with single_camera = 1, or
// when no file is an image.
StatusOr<ImageRegistration> RegisterImages(
    const FeatureOptions& options, const std::string& image_path,
    const std::vector<std::string>& names, const std::string& database_path,
    const ProgressCallback& progress);

// Keypoints and descriptors of the images registered, by the host's SIFT. What
// the host prints goes to log_path.
Status ExtractFeatures(const FeatureOptions& options,
                       const std::string& image_path,
                       const std::string& database_path,
                       const std::string& log_path,
                       const ProgressCallback& progress);

// Matches the pairs and verifies them (two-view geometries), by
// options.matcher, "adasfm" with the help of the predictor if there is one. An
// error for descriptors that this matcher cannot compare. num_guided: pairs
// whose geometry is the predicted one.
Status MatchPairs(const FeatureOptions& options,
                  const std::vector<ImagePair>& pairs,
                  const std::string& database_path, const std::string& log_path,
                  const ProgressCallback& progress,
                  const MotionPredictor& predictor = {},
                  int* num_guided = nullptr);

// An error when keypoints or descriptors of an image are missing: COLMAP
// reports no failed write.
Status CheckFeatures(const std::string& database_path);

// The same for matches and two-view geometries of the pairs.
Status CheckMatches(const std::string& database_path,
                    const std::vector<ImagePair>& pairs);

}  // namespace adasfm
