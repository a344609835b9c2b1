// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/report/report_pairs.h"
#include "colmap_ext/report/report_scene.h"
#include "core/sqlite.h"

namespace adasfm {

// Select example pairs. No two pairs of a list connect about the same places,
// unless there are too few others; ties are broken by the order of their
// indices.

// Removed by adasfm_global: those with most inliers, which look most similar.
std::vector<ReportPair> SelectRemovedExamples(const ReportPairs& pairs,
                                              size_t num_images,
                                              size_t max_num_pairs);

// Kept: alternately the pairs whose images are furthest apart in the sequence,
// and those with fewest inliers. A wrong kept pair is most likely among them.
std::vector<ReportPair> SelectKeptExamples(const ReportPairs& pairs,
                                           size_t num_images,
                                           size_t max_num_pairs);

// A <figure> for each pair: both photos as one embedded JPEG, with matches as
// lines over it. image_path: the folder that image names are relative to. A
// kept pair shows its present inliers and the other raw matches, a removed pair
// its former inliers. A pair with a photo that cannot be read is left out and
// counted in num_unreadable. Throws SqliteError.
std::string FormatExamples(const std::vector<ReportPair>& pairs,
                           const ReportScene& scene,
                           const std::string& image_path,
                           SqliteConnection* database, int* num_unreadable);

}  // namespace adasfm
