// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/report/report_scene.h"
#include "core/sqlite.h"

namespace adasfm {

// Values counted in bins of equal width from 0; the last one takes all that
// lies beyond. {"width", "counts"}.
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

// A pair of images by their indices in the scene, index1 < index2, and its
// number of inlier matches before and after adasfm_global (0: not verified, or
// removed) and of raw matches.
struct ReportPair {
  size_t index1 = 0;
  size_t index2 = 0;
  int64_t num_before = 0;
  int64_t num_after = 0;
  int64_t num_raw = 0;
};

// What a database says of its verified pairs, before and after adasfm_global.
struct ReportPairs {
  std::vector<ReportPair> pairs;
  // Share of the raw matches that verification kept, per pair; null without
  // raw matches.
  nlohmann::json inlier_ratios_before;
  nlohmann::json inlier_ratios_after;
  int64_t num_before = 0;
  int64_t num_after = 0;
  bool was_rewritten = false;
};

// Pairs with fewer inliers than COLMAP's own 15 do not count. Reads no match,
// so that memory follows the number of pairs alone. Throws SqliteError.
ReportPairs ReadReportPairs(const ReportScene& scene,
                            SqliteConnection* database);

// For the matrix: packed arrays, one entry a pair. The matrix has at most
// max_size cells a side; with more images, neighbours share a cell, which shows
// the largest number of its pairs.
nlohmann::json PairsToJson(const ReportPairs& pairs, size_t num_images,
                           size_t max_size);

// The pairs of removed_pairs.txt (`name1 name2` a line, names may have spaces,
// then a tab and the reason) as indices; lines with unknown names are counted
// only.
struct RemovedPairs {
  std::vector<std::pair<size_t, size_t>> pairs;
  int num_unknown = 0;
};
RemovedPairs ReadRemovedPairs(const std::string& path,
                              const ReportScene& scene);

}  // namespace adasfm
