// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/stopwatch.h"
#include "global/estimate_coarse_poses.h"

namespace adasfm {

// The state that the steps of EstimateCoarsePoses share. Each step is a member
// function that ends by recording its name, time and summary (EndStep).
class CoarsePoseEstimator {
 public:
  CoarsePoseEstimator(const CoarsePoseOptions& options, const ViewGraph& graph,
                      const GlobalCorrespondences& correspondences,
                      const std::vector<RelativePosePrior>& priors,
                      const std::vector<RelativePosePrior>& frame_priors)
      : options_(options),
        correspondences_(correspondences),
        priors_(priors),
        frame_priors_(frame_priors),
        chain_options_(options.chain),
        graph_(graph) {}

  CoarsePoses Run();

 private:
  using Rotations = std::map<image_t, Eigen::Quaterniond>;
  void RefinePairs();
  void BuildChain();
  std::vector<std::optional<RotationPrediction>> PredictRotations() const;
  void FilterLoops();
  VisualOdometryEdges CompleteOdometry() const;
  bool IsSequence(const OdometryChain& chain) const;
  TrajectoryOdometry BuildTrajectoryOdometry(std::string* summary) const;
  int AddSensors();
  std::vector<RelativePosePrior> AllPriors() const;
  void EstimateRotations();
  void FilterByRotation();
  void RepeatRotations();
  std::vector<std::optional<RotationPrediction>> PredictFromRotations() const;
  void EstimateTranslations();
  void EstimatePositions();
  std::vector<std::vector<image_t>> FindComponentsByDirection() const;
  std::vector<std::vector<image_t>> FindDirectedComponents() const;
  int JoinAtRest();
  bool OdometryMoves(const ViewGraphEdge& edge) const;
  GlobalPositions EstimatePositionsOf(const std::vector<image_t>& images) const;
  bool HasMetresEverywhere() const;
  int SplitWhereSizeIsUnknown(bool has_joins_at_rest);
  int ReportUnconfirmedClosures();
  int EstimateComponent(const std::vector<image_t>& images);
  int RemoveEdgesOffPositions();
  EdgeLengths EstimateLengths() const;
  std::map<ImagePair, double> KnownLengths() const;
  std::vector<std::optional<EdgeLength>> SelectLengths(
      const ViewGraph& subgraph) const;
  std::map<image_t, Eigen::Vector3d> StartFromChain(
      std::vector<image_t> images) const;
  void EndStep(const std::string& name, const std::string& summary);

  const CoarsePoseOptions& options_;
  const GlobalCorrespondences& correspondences_;
  std::vector<RelativePosePrior> priors_;
  const std::vector<RelativePosePrior>& frame_priors_;
  OdometryChainOptions chain_options_;
  ViewGraph graph_;
  OdometryChain chain_;
  EdgeLengths lengths_;
  Rotations rotations_;
  std::map<image_t, bool> rotation_converged_;
  std::map<image_t, double> sdp_optimality_;
  CoarsePoses result_;
  Stopwatch step_watch_;
};

}  // namespace adasfm
