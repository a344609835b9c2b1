// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/part_checkpoint.h"

#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/model_checkpoint.h"

namespace adasfm {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PartReport, part_index, failure, num_images,
                                   num_registered, num_points,
                                   num_registered_by_global_pose,
                                   num_global_adjustments, mean_reproj_error_px,
                                   keypoint_sigma_factor, seconds, retry_reason,
                                   prior_only_images)

std::string PartCheckpointPath(const std::string& checkpoint_path,
                               int part_index) {
  return checkpoint_path + "/part_" + std::to_string(part_index);
}

Status WritePartCheckpoint(const std::string& path,
                           const std::string& fingerprint,
                           const PartReport& report,
                           const colmap::Reconstruction* reconstruction) {
  return WriteModelCheckpoint(path, fingerprint, nlohmann::json(report),
                              reconstruction);
}

StatusOr<PartReport> ReadPartReport(const std::string& path,
                                    const std::string& fingerprint,
                                    int part_index) {
  const StatusOr<nlohmann::json> state = ReadCheckpointState(path, fingerprint);
  if (!state.ok()) return state.status();
  try {
    const PartReport report = state->get<PartReport>();
    if (report.part_index != part_index) {
      return Status::Error(path + " holds part " +
                           std::to_string(report.part_index));
    }
    if (report.failure.empty() && !state->contains("files")) {
      return Status::Error(path + " has no model");
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return Status::Error("the part at " + path + " is damaged");
  }
}

StatusOr<colmap::Reconstruction> ReadPartModel(const std::string& path) {
  return ReadCheckpointModel(path);
}

}  // namespace adasfm
