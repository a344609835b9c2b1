// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/matching/motion_prediction.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// Extracts features and matches them by the host's own classes, into a database
// that those classes create; when the environment variable ADASFM_HOST_COLMAP
// names a program, by that program instead (host_features.h). Results that are
// in the database already are not computed again, so that an interrupted run
// continues. An interruption (core/interruption.h) by the progress callback
// leaves the database consistent.

struct FeatureOptions {
  std::string camera_model = "SIMPLE_RADIAL";
  // Comma-separated, in the model's order. Empty: focal length from EXIF, else
  // 1.2 times the longer side.
  std::string camera_params;
  // Size of the photos that camera_params belong to; 0: unknown.
  int camera_width_px = 0;
  int camera_height_px = 0;
  // 1: all photos share one camera; 0: each photo has its own; 2: photos of
  // equal size in a folder share one, as with one lens per folder; -1: photos
  // of equal size and equal initial parameters share one.
  int single_camera = -1;
  // Larger photos are scaled down for the detector.
  int max_image_size = 2000;
  // The largest features are kept. The time of matching grows with the square
  // of this number, the number of points in the model linearly; poses need a
  // few hundred features (docs/results/matching.md).
  int max_num_features = 2048;
  // "colmap": the host's SIFT; "opencv": OpenCV's on the CPU, with the host's
  // settings and in a third of its time (features/sift_features.h).
  std::string extractor = "colmap";
  // -1: SIFT starts with the photo at twice its size, as COLMAP does; 0: at its
  // own size, which takes a quarter of the time and finds fewer and larger
  // features.
  int first_octave = -1;
  // 1, 0, or -1: only when the host was built with CUDA and a device is
  // present.
  int use_gpu = -1;
  // "adasfm": compares all descriptors (match_sift_pairs.h); "host": COLMAP's
  // matcher. A GPU and the program of ADASFM_HOST_COLMAP always use COLMAP's
  // matcher.
  std::string matcher = "adasfm";
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct ImageRegistration {
  int num_images = 0;
  int num_cameras = 0;
  // Cameras with a focal length from EXIF or from the options.
  int num_known_focal_lengths = 0;
  // Files that the host cannot read as images.
  std::vector<std::string> unreadable;
};

// Whether SIFT runs on the GPU with these options.
bool UsesGpu(const FeatureOptions& options);
// An error when the options demand a GPU that the host cannot use.
Status CheckGpu(const FeatureOptions& options);

// Creates the database when needed and writes cameras and images, with ids in
// the order of `names` (relative to image_path). Reading the photos takes most
// of the time. An error for photos of different sizes with single_camera = 1,
// or when no file is an image.
StatusOr<ImageRegistration> RegisterImages(
    const FeatureOptions& options, const std::string& image_path,
    const std::vector<std::string>& names, const std::string& database_path,
    const ProgressCallback& progress);

// Extracts keypoints and descriptors of the registered images, by the host's
// SIFT. Output that the host prints goes to log_path.
Status ExtractFeatures(const FeatureOptions& options,
                       const std::string& image_path,
                       const std::string& database_path,
                       const std::string& log_path,
                       const ProgressCallback& progress);

// Matches the pairs and verifies them (two-view geometries) by options.matcher;
// "adasfm" uses the predictor if there is one. An error for descriptors that
// this matcher cannot compare. num_guided: number of pairs whose geometry is
// the predicted one.
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
