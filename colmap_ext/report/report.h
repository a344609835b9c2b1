// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/evaluation/evaluation.h"
#include "core/status.h"

namespace adasfm {

struct ReportOptions {
  // A folder with a COLMAP model, or a folder of models, of which the largest
  // is shown. The mapper's summary.json in the parent folder is read, too.
  std::string input_path;
  // Optional inputs. Without one, its sections are left out, which the report
  // states.
  std::string coarse_path;  // as input_path, of adasfm_global
  std::string database_path;
  std::string ground_truth_path;
  GroundTruthOptions ground_truth;
  // The folder of the photos, for pairs with their matches; needs
  // database_path.
  std::string image_path;

  bool IsValid(std::string* error) const;
};

// Builds one self-contained HTML page, which needs no network
// (docs/guide/report.md). The same input gives the same page. An error when a
// given input cannot be read.
StatusOr<std::string> BuildReport(const ReportOptions& options);

}  // namespace adasfm
