// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/stage_summaries.h"

#include <sstream>

#include "global/view_graph/tracks.h"

namespace adasfm {

std::string DescribeViewGraph(const InitialViewGraph& initial) {
  std::ostringstream text;
  text << initial.graph.images.size() << " images, "
       << initial.graph.edges.size() << " pairs: " << initial.num_stored_poses
       << " poses stored, " << initial.num_decomposed << " decomposed, "
       << initial.num_reestimated << " estimated anew, "
       << initial.num_without_pose << " without";
  return text.str();
}

std::string DescribeTrackMemory(const CoarseModelInput& input) {
  std::ostringstream text;
  text << "structure, tracks take at most "
       << (EstimateTrackBytes(input.matches) >> 20) + 1 << " MiB";
  return text.str();
}

std::string DescribeModel(const CoarseModel& model) {
  std::ostringstream text;
  text.precision(3);
  text << model.reconstruction.NumRegImages() << " images, " << model.num_points
       << " points, " << model.num_observations << " observations, "
       << model.mean_reproj_error_px << " px, angles >= " << model.min_angle_deg
       << " deg";
  if (model.num_images_without_points > 0) {
    text << ", " << model.num_images_without_points << " images without points";
  }
  for (const PriorBundleAdjustmentSummary& round : model.rounds) {
    if (!round.success) text << ", adjustment failed: " << round.message;
  }
  return text.str();
}

std::string DescribeMatches(const GlobalStageResult& result) {
  std::ostringstream text;
  text << result.refinement.num_kept << " of "
       << result.refinement.num_candidates << " matches in "
       << result.geometries.size() << " pairs, " << result.removed_pairs.size()
       << " pairs removed, " << result.refinement.num_skipped_pairs
       << " left as they were";
  return text.str();
}

std::string DescribeSizes(const GlobalStageResult& result) {
  std::ostringstream text;
  text.precision(2);
  for (const CoarseModel& model : result.models) {
    text << (text.tellp() > 0 ? ", " : "");
    if (model.inertial_scale_sigma > 0.0) {
      text << "to " << 100.0 * model.inertial_scale_sigma << " %";
    } else {
      text << (model.metric ? "not needed" : "none");
    }
  }
  return text.str();
}

}  // namespace adasfm
