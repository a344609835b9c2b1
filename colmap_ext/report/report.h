// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/evaluation/evaluation.h"
#include "core/status.h"

namespace adasfm {

struct ReportOptions {
  // The model: a folder with a COLMAP model, or a folder of models, of which
  // the largest is shown. The mapper's summary.json beside it is read too.
  std::string input_path;
  // What may be empty leaves its sections out, and the report says so.
  std::string coarse_path;  // as input_path, of adasfm_global
  std::string database_path;
  std::string ground_truth_path;
  GroundTruthOptions ground_truth;
  // The 3D view holds at most so many points: more make the file large and
  // turning it slow, without showing more.
  int max_num_points = 20000;
  // Pairs shown with their matches on the photos, of each of removed and kept
  // ones; each adds about 60 kB. Without image_path there are none.
  std::string image_path;
  int max_num_examples = 4;

  bool IsValid(std::string* error) const;
};

// One HTML page with everything in it, that needs no network
// (docs/guide/report.md). The same input gives the same page. An error when
// something that was given cannot be read.
StatusOr<std::string> BuildReport(const ReportOptions& options);

}  // namespace adasfm
