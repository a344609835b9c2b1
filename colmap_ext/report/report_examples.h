// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/report/report_pairs.h"
#include "colmap_ext/report/report_scene.h"
#include "core/sqlite.h"

namespace adasfm {

// Pairs worth looking at. No two of a list join about the same places, unless
// there are too few others; equal ones are taken in order of their indices.

// Removed by adasfm_global: those with most inliers, which look most alike.
std::vector<ReportPair> SelectRemovedExamples(const ReportPairs& pairs,
                                              size_t num_images,
                                              size_t max_num_pairs);

// Kept: in turn those whose images are furthest apart in the sequence and
// those with fewest inliers; if any kept pair is wrong, it is likely one of
// them.
std::vector<ReportPair> SelectKeptExamples(const ReportPairs& pairs,
                                           size_t num_images,
                                           size_t max_num_pairs);

struct PhotoOptions {
  // The folder that the images' names start from.
  std::string image_path;
  // Of the shown photo; enough to tell a wrong match on a phone and on paper,
  // at about 30 kB a photo.
  int width_px = 520;
  int jpeg_quality = 70;
  // Lines drawn for each of kept and dropped matches, evenly taken.
  size_t max_num_lines = 60;
};

// A <figure> for each pair: both photos as one JPEG inside, the matches as
// lines over it: for a kept pair the inliers now and the raw matches that are
// not among them, for a removed one the inliers it had. A pair with a photo
// that cannot be read is left out and counted in num_unreadable. Throws
// SqliteError.
std::string FormatExamples(const std::vector<ReportPair>& pairs,
                           const ReportScene& scene,
                           const PhotoOptions& options,
                           SqliteConnection* database, int* num_unreadable);

}  // namespace adasfm
