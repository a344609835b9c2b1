// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/pairs/global_descriptors.h"
#include "colmap_ext/pairs/overlap_predictor.h"
#include "core/progress.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

struct PairSelectionOptions {
  // Every image is matched with this many of the next images in time.
  int num_temporal_neighbors = 10;
  // ... and with this many others (the paper's 30): where the priors in the
  // database predict the overlap, those with the largest overlap; where the
  // prediction is uncertain, the most similar ones.
  int num_similar_images = 30;
  // If false, only pairs that can be selected without features: a subset of the
  // selection with similarity.
  bool use_similarity = true;
  OverlapPredictionOptions odometry;
  // Times of the images (sensors/io/read_image_times.h); empty: those that
  // adasfm_prior_importer left in the database.
  std::string image_times_path;
  // Vectors from elsewhere (ReadGlobalDescriptors); empty: VLAD.
  std::string descriptors_path;
  // -1: all threads of the machine.
  int num_threads = -1;

  bool IsValid(std::string* error) const;
};

struct PairSelection {
  // Sorted, each pair once.
  std::vector<ImagePair> pairs;
  int num_images = 0;
  int num_temporal = 0;
  // Further pairs that the odometry predicts.
  int num_predicted = 0;
  // Pairs found by similarity only.
  int num_similar = 0;
  // If false, images were ordered by name.
  bool ordered_by_time = false;
  std::vector<std::string> warnings;
};

// Selects the pairs of the database's images to match. The database is not
// changed.
StatusOr<PairSelection> SelectPairs(const PairSelectionOptions& options,
                                    const std::string& database_path,
                                    const ProgressCallback& progress = {});

// The image ids in the order of time: by the file or adasfm_image_times if
// every image has a time there, else by name (runs of digits are compared as
// numbers: image2 comes before image10).
StatusOr<std::vector<image_t>> OrderImages(
    const std::string& database_path, const std::string& image_times_path,
    bool* ordered_by_time, std::vector<std::string>* warnings = nullptr);

// Lines `name1 name2`, for matches_importer --match_type pairs. An error for
// names with spaces, which this format does not allow.
StatusOr<std::string> FormatPairList(const std::vector<ImagePair>& pairs,
                                     const std::string& database_path);

}  // namespace adasfm
