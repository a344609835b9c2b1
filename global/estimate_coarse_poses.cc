// SPDX-License-Identifier: BSD-3-Clause
#include "global/estimate_coarse_poses.h"

#include <stdexcept>
#include <utility>

#include "core/option_checker.h"
#include "global/coarse_pose_estimator.h"

namespace adasfm {

CoarsePoses CoarsePoseEstimator::Run() {
  RefinePairs();
  FilterLoops();
  EstimateRotations();
  FilterByRotation();
  RepeatRotations();
  EstimateTranslations();
  EstimatePositions();
  result_.graph = std::move(graph_);
  result_.priors = std::move(priors_);
  return std::move(result_);
}

void CoarsePoseEstimator::EndStep(const std::string& name,
                                  const std::string& summary) {
  result_.steps.push_back({name, step_watch_.Seconds(), summary});
  step_watch_ = Stopwatch();
}

bool CoarsePoseOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
             .Positive({{"max_rotation_discrepancy_deg",
                         max_rotation_discrepancy_deg}})
             .AtLeast(0, "min_num_inliers", min_num_inliers)
             .AllHold() &&
         chain.IsValid(error) && camera_imu_rotation.IsValid(error) &&
         relative_poses.IsValid(error) && loops.IsValid(error) &&
         translations.IsValid(error) && augmentation.IsValid(error);
}

CoarsePoses EstimateCoarsePoses(
    const CoarsePoseOptions& options, const ViewGraph& initial_graph,
    const GlobalCorrespondences& correspondences,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<RelativePosePrior>& frame_priors) {
  std::string error;
  if (!options.IsValid(&error)) {
    throw std::invalid_argument("EstimateCoarsePoses: " + error);
  }
  initial_graph.Check();
  CoarsePoseOptions step_options = options;
  step_options.camera_imu_rotation.num_threads = options.num_threads;
  step_options.relative_poses.num_threads = options.num_threads;
  step_options.translations.num_threads = options.num_threads;
  return CoarsePoseEstimator(step_options, initial_graph, correspondences,
                             priors, frame_priors)
      .Run();
}

}  // namespace adasfm
