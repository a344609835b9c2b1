// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/report/report_scene.h"
#include "core/sqlite.h"

namespace adasfm {

// Counts values in bins of equal width from 0; the last bin also counts all
// larger values. JSON: {"width", "counts"}.
class Histogram {
 public:
  Histogram(double bin_width, int num_bins)
      : bin_width_(bin_width), counts_(num_bins, 0) {}
  void Add(double value);
  int64_t Count() const;
  nlohmann::json ToJson() const;

 private:
  double bin_width_;
  std::vector<int64_t> counts_;
};

// A pair of images by their indices in the scene, index1 < index2, with its
// numbers of inlier matches before and after adasfm_global (0: not verified, or
// removed) and of raw matches.
struct ReportPair {
  size_t index1 = 0;
  size_t index2 = 0;
  int64_t num_before = 0;
  int64_t num_after = 0;
  int64_t num_raw = 0;
};

// The verified pairs of a database, before and after adasfm_global.
struct ReportPairs {
  std::vector<ReportPair> pairs;
  // Histogram of the pairs' ratio of inliers to raw matches; null without raw
  // matches.
  nlohmann::json inlier_ratios_before;
  nlohmann::json inlier_ratios_after;
  int64_t num_before = 0;
  int64_t num_after = 0;
  bool was_rewritten = false;
};

// Ignores pairs with fewer inliers than COLMAP's minimum of 15. Reads no
// matches, so that memory depends on the number of pairs only. Throws
// SqliteError.
ReportPairs ReadReportPairs(const ReportScene& scene,
                            SqliteConnection* database);

// For the matrix: packed arrays, one entry per cell. The matrix has at most
// max_size cells per side; with more images, neighbours share a cell, which
// shows the largest counts of its pairs.
nlohmann::json PairsToJson(const ReportPairs& pairs, size_t num_images,
                           size_t max_size);

// The pairs of removed_pairs.txt, as indices. Each line is `name1 name2`, where
// names may have spaces, then a tab and the reason. Lines with unknown names
// are only counted.
struct RemovedPairs {
  std::vector<std::pair<size_t, size_t>> pairs;
  int num_unknown = 0;
};
RemovedPairs ReadRemovedPairs(const std::string& path,
                              const ReportScene& scene);

}  // namespace adasfm
