// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "colmap_ext/host/colmap.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// Report on one part.
struct PartReport {
  int part_index = 0;
  // Empty for a part that was reconstructed; otherwise why it was not.
  std::string failure;
  int num_images = 0;
  int num_registered = 0;
  int num_points = 0;
  int num_registered_by_global_pose = 0;
  int num_global_adjustments = 0;
  double mean_reproj_error_px = 0.0;
  double keypoint_sigma_factor = 1.0;
  double seconds = 0.0;
  // Set when the first try threw.
  std::string retry_reason;
  std::set<image_t> prior_only_images;
};

std::string PartCheckpointPath(const std::string& checkpoint_path,
                               int part_index);

// A part's checkpoint (model_checkpoint.h); without a model when it failed.
Status WritePartCheckpoint(const std::string& path,
                           const std::string& fingerprint,
                           const PartReport& report,
                           const colmap::Reconstruction* reconstruction);

// An error when the folder is missing, damaged, of another fingerprint or of
// another part.
StatusOr<PartReport> ReadPartReport(const std::string& path,
                                    const std::string& fingerprint,
                                    int part_index);

// The model of a part whose report has no failure.
StatusOr<colmap::Reconstruction> ReadPartModel(const std::string& path);

}  // namespace adasfm
