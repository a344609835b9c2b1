// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>
#include <ceres/problem.h>

#include <map>
#include <memory>
#include <vector>

#include "colmap_ext/cost_functions/pose_prior_cost.h"
#include "colmap_ext/cost_functions/pose_prior_edge.h"
#include "colmap_ext/cost_functions/shared_errors.h"

namespace adasfm {

// The errors that the priors of an adjustment share, as parameters of three
// numbers each, or of one (shared_errors.h). Errors that affect no prior have
// none.
class SharedErrorBlocks {
 public:
  // The windows of the edges must be set (AssignSharedErrorWindows).
  SharedErrorBlocks(const SharedErrorOptions& options,
                    const std::vector<PosePriorEdge>& edges);
  SharedErrorBlocks(const SharedErrorBlocks&) = delete;
  SharedErrorBlocks& operator=(const SharedErrorBlocks&) = delete;

  // The errors that affect a term of an edge; they are used from then on.
  std::vector<double*> ParametersOf(const PosePriorEdge& edge,
                                    const PosePriorCost& cost,
                                    PosePriorCost::Term term);
  // Adds the priors of the errors that terms use. The problem owns no costs;
  // these live as long as this object.
  void AddPriors(ceres::Problem* problem);
  // The rotation error of T_cam_imu in a drive; it is used from then on.
  double* ExtrinsicRotation(int drive, ceres::Problem* problem);

  std::vector<double*> Used();
  SharedErrors Estimated() const;

 private:
  struct Block {
    double values[3] = {0, 0, 0};
    int drive = 0;
  };
  // Those in use, by drive or by window.
  using Blocks = std::map<int, Block>;

  void AddGyroscopePriors(ceres::Problem* problem);
  void AddDirectionDriftPriors(ceres::Problem* problem);
  void AddLengthScalePriors(ceres::Problem* problem);
  void AddTimeShiftPriors(ceres::Problem* problem);
  // A normal prior around zero of a weighted sum.
  void AddSumPrior(double sigma, std::vector<double> weights,
                   const std::vector<double*>& values, ceres::Problem* problem);
  // A normal prior around zero; sigma 0 holds the values.
  void AddPrior(double sigma, Block* block, ceres::Problem* problem);
  // A normal prior of the change from decay * before to block.
  void AddStep(double sigma, double decay, Block* before, Block* block,
               ceres::Problem* problem);

  const SharedErrorOptions options_;
  double direction_drift_sigma_rad_ = 0.0;
  Blocks extrinsic_rotation_;  // by drive
  Blocks gyroscope_scale_;     // by drive
  Blocks driving_direction_;   // by drive
  Blocks gyroscope_bias_;      // by window
  Blocks direction_drift_;     // by window
  struct LengthScale {
    double value = 0.0;
    int num_lengths = 0;
  };
  std::map<int, LengthScale> length_scale_;  // by drive
  std::map<int, double> time_shift_;         // by drive
  std::vector<std::unique_ptr<ceres::CostFunction>> costs_;
};

}  // namespace adasfm
